"""`DotMask/Masking-v0`: the agent is the masking front end, and is judged in the standard loop."""

from collections.abc import Mapping
from typing import Any

from gymnasium import spaces

from dotmask.evaluation.masks import count_masking
from dotmask.records import MaskImage, RgbdFrame
from scenarios.envs.base import Info, Observation, ScenarioEnv
from scenarios.errors import ScenarioError
from scenarios.given_masks import GivenMasks, Masks, checked_mask
from scenarios.spec import Scenario


class Masking(ScenarioEnv[Any]):
    """See a frame, answer with what to hide: the camera goes the scenario's own way, SLAM is fed the rest.

    The action is a mask (H, W), 1 = hidden from odometry and from the map; with `map_mask` it is a Dict of two masks,
    `odometry` and `map`. An episode has as many steps as the scenario has frames: the step answers the frame observed
    last, and the observation after the last step is the last frame again. See docs/gym.md.

    The scenario's oracle is `env.unwrapped.oracle`: it segments the observed frame, with the scenario's faults.

    Args:
        scenario: see `ScenarioEnv`.
        overrides: see `ScenarioEnv`.
        map_mask: whether the map gets a mask of its own.
        **shared: see `ScenarioEnv`.

    Raises:
        ScenarioError: what is asked for does not exist.
    """

    def __init__(
        self,
        scenario: str | Scenario = "smoke",
        overrides: Mapping[str, Any] | None = None,
        *,
        map_mask: bool = False,
        **shared: Any,
    ) -> None:
        super().__init__(scenario, overrides, **shared)
        self._size = (self.intrinsics.height, self.intrinsics.width)
        mask = spaces.MultiBinary(self._size)
        self._map_mask = map_mask
        self.action_space = spaces.Dict({"odometry": mask, "map": spaces.MultiBinary(self._size)}) if map_mask else mask
        self.observation_space = spaces.Dict(self.image_spaces())

    def frame(self) -> RgbdFrame:
        """The frame that was observed last, as the methods take it."""
        return self._seen[0]

    def _begin(self) -> tuple[Observation, Info]:
        self._front_end = GivenMasks(self._size)
        self._index = 0
        self._seen = self._frame(0)
        # The agent has no use for a pose that is predicted: the feedback does not matter.
        self._closed_loop = self._loop(self._front_end, "previous", self._seen[1].T_world_camera)
        return self.images(self._seen[0]), self._known()

    def _advance(self, action: Masks) -> tuple[Observation, dict[str, float], bool, Info]:
        self._front_end.from_odometry, self._front_end.from_map = self._given(action)
        frame, truth = self._seen
        result, error = self._run(self._closed_loop, frame, truth)
        moving = [actor.instance_id for actor in truth.objects if actor.is_moving]
        counts = count_masking(frame.depth_m, result.front_end.masked.mo_mdi_m, truth.instance_ids, moving)
        waste = counts.waste or 0.0
        terms = {"odometry_error": -error, "waste": -self.weights.waste * waste}
        info = {
            **self._known(),
            "true_pose": truth.T_world_camera.copy(),
            "leak": counts.leak or 0.0,
            "waste": waste,
        }
        is_last = self._index + 1 == len(self.simulator)
        if not is_last:
            self._index += 1
            self._seen = self._frame(self._index)
        return self.images(self._seen[0]), terms, is_last, info

    def _given(self, action: Masks) -> tuple[MaskImage, MaskImage]:
        if self._map_mask:
            if not isinstance(action, Mapping):
                raise ScenarioError("masking: with map_mask the action is {'odometry': mask, 'map': mask}")
            return checked_mask(action["odometry"], self._size), checked_mask(action["map"], self._size)
        mask = checked_mask(action, self._size)
        return mask, mask
