"""What a sensor fails to deliver for a while: the colour, the depth, or whole frames.

They come on top of the errors that every image has, as a covered lens, a switched off projector or a stalled bus do.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

FailureKind = Literal["black", "no_depth", "missing"]
"""The colour image is black; the depth image has no return; no frame is delivered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFailure:
    """One failure of the sensor.

    Attributes:
        kind: see `FailureKind`.
        first: number of the first captured frame that fails; frame 0 is always delivered.
        frames: how many fail.
    """

    kind: FailureKind
    first: int
    frames: int

    def __post_init__(self) -> None:
        """Refuse what fails never, or from the beginning."""
        if self.first < 1 or self.frames < 1:
            raise ValueError("sensor failure: the first frame never fails, and at least one frame does")

    def acts_on(self, captured: int) -> bool:
        """Whether the captured frame of this number fails."""
        return self.first <= captured < self.first + self.frames


def delivered(captured: npt.NDArray[np.int64], failures: tuple[SensorFailure, ...]) -> npt.NDArray[np.int64]:
    """The numbers of the `captured` frames that are not missing, ascending."""
    missing = [f for f in failures if f.kind == "missing"]
    return captured[[not any(f.acts_on(int(number)) for f in missing) for number in captured]]


def failed(
    rgb: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32], captured: int, failures: tuple[SensorFailure, ...]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """Both images of the captured frame of this number, after the failures that act on it."""
    acting = {f.kind for f in failures if f.acts_on(captured)}
    return (
        np.zeros_like(rgb) if "black" in acting else rgb,
        np.zeros_like(depth_m) if "no_depth" in acting else depth_m,
    )
