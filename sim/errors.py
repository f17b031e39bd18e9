"""Errors that the simulator raises when the world is not as it must be."""


class SimError(Exception):
    """Root of the errors that a user can mend; the message says how."""


class AssetError(SimError):
    """An asset is missing, damaged, or not in the manifest."""


class CameraPathError(SimError):
    """A camera path cannot be built, or a trajectory file cannot be replayed."""


class MotionError(SimError):
    """A motion cannot be built from what was given."""
