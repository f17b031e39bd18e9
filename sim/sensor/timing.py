"""When a camera looks: exposure, rolling shutter, the delay between colour and depth, lost frames, wrong stamps.

The frame with the number k is captured at `k / rate`. This is the middle of the exposure of the middle row of the
colour image, and the time of the truth. The depth image is taken at once, `depth_delay_s` later.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.randomness import child

JITTER_LIMIT = 0.45
"""A stamp is never farther off than this share of a period, so that stamps increase."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """The errors in time. The defaults switch every error off.

    Attributes:
        exposure_s: each row of the colour image collects light for so long.
        readout_s: from the exposure of the first row of the colour image to one period of rows after the last: row v
            of H is exposed `readout_s (v - (H - 1) / 2) / H` later than the middle row.
        depth_delay_s: from the frame's time to the depth image; negative = depth is earlier.
        dropped_share: of the frames, chosen at random, that are never delivered.
        stamp_sigma_s: standard deviation of the stamps, cut off at 0.45 periods.
    """

    exposure_s: float = 0.0
    readout_s: float = 0.0
    depth_delay_s: float = 0.0
    dropped_share: float = 0.0
    stamp_sigma_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse numbers that describe no camera."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value) or (value < 0 and field.name != "depth_delay_s"):
                raise ValueError(f"sensor timing: {field.name} must be finite and not negative, got {value}")
        if self.dropped_share >= 1:
            raise ValueError(f"sensor timing: a share of {self.dropped_share} dropped frames leaves nothing")

    @property
    def is_instant(self) -> bool:
        """Whether the whole colour image is taken at one time."""
        return self.exposure_s == 0 and self.readout_s == 0

    def delivered(self, frames: int, seed: int) -> npt.NDArray[np.int64]:
        """Numbers of the captured frames that are delivered, ascending; the first always is."""
        kept = child(seed, "sensor", "dropped").random(frames) >= self.dropped_share
        kept[0] = True
        return np.flatnonzero(kept)

    def stamps_s(self, captured: npt.NDArray[np.int64], frame_rate_hz: float, seed: int) -> FloatArray:
        """Time stamps of the captured frames with these numbers, strictly increasing; microseconds when jittered."""
        exact = np.asarray(captured / frame_rate_hz)
        if self.stamp_sigma_s == 0:
            return exact
        limit = JITTER_LIMIT / frame_rate_hz
        error = child(seed, "sensor", "stamps").normal(0.0, self.stamp_sigma_s, int(captured[-1]) + 1)[captured]
        return np.asarray(np.round(exact + np.clip(error, -limit, limit), 6))

    def row_times_s(self, height: int) -> FloatArray:
        """(height,) middle of each row's exposure, from the time of the frame."""
        return np.asarray(self.readout_s * (np.arange(height) - (height - 1) / 2) / height)
