"""Front ends that hide what somebody else has chosen: an agent, or a function."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from dotmask.pipeline import FrontEndResult, StageClock
from dotmask.records import ColourImage, DepthImage, FloatArray, Intrinsics, MaskedDepth, MaskImage, RgbdFrame
from scenarios.errors import ScenarioError

Mask = npt.NDArray[Any]
Masks = Mask | Mapping[str, Mask]
"""(H, W), true or not 0 = hidden from odometry and from the map; or two of them, `odometry` and `map`."""

MaskChoice = Callable[[ColourImage, DepthImage, float], Masks]
"""Says what to hide in a frame: colour (H, W, 3) uint8 RGB, depth (H, W) float32 metres with 0 = no return, stamp in
seconds. The frames come in the order of time; the images are the function's own."""


def checked_mask(mask: Any, size: tuple[int, int]) -> MaskImage:
    """A mask as bool.

    Raises:
        ScenarioError: it does not have the size (H, W) of the image.
    """
    given = np.asarray(mask)
    if given.shape != size:
        raise ScenarioError(f"masking: a mask has the size of the image, {size}; got {given.shape}")
    return np.asarray(given != 0)


class GivenMasks:
    """A front end that hides what somebody else has chosen.

    Attributes:
        from_odometry: (H, W) bool, hidden from odometry in the next frame.
        from_map: (H, W) bool, hidden from the map.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.from_odometry = np.zeros(size, np.bool_)
        self.from_map = np.zeros(size, np.bool_)

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See `dotmask.pipeline.FrontEnd`."""
        zero = np.float32(0)
        self._result = FrontEndResult(
            detections=None,
            observations=(),
            tracks=(),
            masked=MaskedDepth(
                mo_mdi_m=np.where(self.from_odometry, zero, frame.depth_m),
                mdi_m=np.where(self.from_map, zero, frame.depth_m),
            ),
            stage_seconds={},
        )
        return self._result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Nothing depends on the pose."""
        return self._result


class ChosenMasks:
    """A front end that asks a function what to hide.

    Args:
        choose: see `MaskChoice`.
        camera: of the frames.
    """

    def __init__(self, choose: MaskChoice, camera: Intrinsics) -> None:
        self._choose, self._size = choose, (camera.height, camera.width)
        self._given = GivenMasks(self._size)

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See `dotmask.pipeline.FrontEnd`.

        Raises:
            ScenarioError: what the function gives is no mask of the size of the image, and no pair of them.
        """
        clock = StageClock()
        with clock("mask"):
            masks = self._choose(frame.rgb.copy(), frame.depth_m.copy(), frame.timestamp_s)
        if isinstance(masks, Mapping):
            if set(masks) != {"odometry", "map"}:
                raise ScenarioError(f"masking: give a mask, or {{'odometry': mask, 'map': mask}}; got {list(masks)}")
            self._given.from_odometry = checked_mask(masks["odometry"], self._size)
            self._given.from_map = checked_mask(masks["map"], self._size)
        else:
            self._given.from_odometry = self._given.from_map = checked_mask(masks, self._size)
        return replace(self._given.step(frame, T_world_camera), stage_seconds=clock.seconds)

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """Nothing depends on the pose."""
        return self._given.refine(T_world_camera)
