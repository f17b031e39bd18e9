"""What can go wrong in a training."""

from dotmask.errors import DotmaskError


class TrainingError(DotmaskError):
    """The training cannot begin or go on; the message says what to do."""
