"""Errors that the method raises when the world is not as it must be."""


class DotmaskError(Exception):
    """Root of the errors that a user can mend; the message says how."""


class TrajectoryFileError(DotmaskError):
    """A trajectory file cannot be read: wrong columns, not finite, or times out of order."""


class ProfileError(DotmaskError):
    """No profile has this name."""


class SequenceFolderError(DotmaskError):
    """A folder in the TUM RGB-D format cannot be read or written."""


class SlamError(DotmaskError):
    """A SLAM back end is not installed, was given a wrong parameter, or has failed."""


class VocabularyError(DotmaskError):
    """The visual vocabulary of place recognition is missing or damaged."""


class SegmenterError(DotmaskError):
    """A network cannot be used: a package or a device is missing, or its weights are not what they should be."""
