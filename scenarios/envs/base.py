"""What both environments share: the scenario, its seed, the sequence of frames, lost SLAM, and the pictures."""

from collections.abc import Mapping
from typing import Any, Generic, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces

from dotmask.pipeline import ClosedLoop, FrameResult, FrontEnd
from dotmask.profiles import PoseFeedback
from dotmask.records import FloatArray, Intrinsics, RgbdFrame
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from scenarios.camera import camera_model
from scenarios.envs.reward import PoseError, RewardWeights
from scenarios.envs.window import Window
from scenarios.errors import ScenarioError, unknown
from scenarios.faults.chain import Faults
from scenarios.oracle import OracleSegmenter
from scenarios.registry import chosen_scenario
from scenarios.run import one_opencv_thread
from scenarios.spec import Scenario, with_overrides
from scenarios.video import PathsPanel, Picture, colour_panel, depth_panel, hidden_panel, side_by_side
from scenarios.world import RENDERERS, build_simulator
from sim.records import GroundTruth
from sim.simulator import Simulator

Observation = dict[str, Any]
Info = dict[str, Any]
Action = TypeVar("Action")

FARTHEST_M = 100.0
"""No room is as large: the bound of depths and positions in the observations."""


class ScenarioEnv(gymnasium.Env[Observation, Action], Generic[Action]):
    """A scenario as an episode: SLAM runs in it, frame by frame.

    `reset(seed=N)` sets the scenario's seed: another look of the room, other sensor noise. `reset()` repeats the
    scenario as it was last, or draws a seed where `vary_seed` is set; the draw is fixed by the last seed given.

    Args:
        scenario: a name, or a scenario.
        overrides: see `scenarios.registry.chosen_scenario`.
        vary_seed: whether a reset without a seed is another world.
        lost_frames: the episode is terminated when SLAM has been lost for so many frames in a row.
        weights: of the terms of the reward.
        renderer: of `RENDERERS`.
        threads: of the renderer; the bytes do not depend on it.
        render_mode: None, "rgb_array" or "human".

    Raises:
        ScenarioError: what is asked for does not exist.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 30}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self,
        scenario: str | Scenario = "smoke",
        overrides: Mapping[str, Any] | None = None,
        *,
        vary_seed: bool = False,
        lost_frames: int = 15,
        weights: RewardWeights | None = None,
        renderer: str = "numba",
        threads: int = 1,
        render_mode: str | None = None,
    ) -> None:
        self.scenario = chosen_scenario(scenario, overrides or {})
        if self.scenario.frames < 2:
            raise ScenarioError(f"{self.scenario.name}: an episode needs at least 2 frames, got 1")
        if renderer not in RENDERERS:
            raise unknown("renderer", renderer, RENDERERS)
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise unknown("render mode", render_mode, self.metadata["render_modes"])
        if lost_frames < 1:
            raise ScenarioError(f"lost_frames: expected 1 or more, got {lost_frames}")
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": self.scenario.frame_rate_hz}
        self.intrinsics: Intrinsics = intrinsics_from_camera(camera_model(self.scenario.camera))
        self.weights = weights or RewardWeights()
        self._vary_seed, self._lost_frames = vary_seed, lost_frames
        self._renderer, self._threads = renderer, threads
        self._simulator: Simulator | None = None
        self._window: Window | None = None

    def image_spaces(self) -> dict[str, spaces.Space[Any]]:
        """What every observation holds: `rgb` (H, W, 3) uint8, `depth` (H, W) metres, `stamp` (1,) seconds."""
        size = (self.intrinsics.height, self.intrinsics.width)
        last_s = self.scenario.frames / self.scenario.frame_rate_hz
        return {
            "rgb": spaces.Box(0, 255, (*size, 3), np.uint8),
            "depth": spaces.Box(0, FARTHEST_M, size, np.float32),
            "stamp": spaces.Box(0, last_s, (1,), np.float64),
        }

    def images(self, frame: RgbdFrame) -> Observation:
        """The part of an observation that `image_spaces` tells; the arrays are new."""
        return {"rgb": frame.rgb.copy(), "depth": frame.depth_m.copy(), "stamp": np.array([frame.timestamp_s])}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, Info]:
        """Begin the scenario, with another seed where one is given; see the class. There are no options.

        Raises:
            ScenarioError, SimError: the scenario's world cannot be built.
        """
        super().reset(seed=seed)
        if seed is None and self._simulator is not None and self._vary_seed:
            seed = int(self.np_random.integers(2**63 - 1))
        if seed is not None and seed != self.scenario.seed:
            self.scenario = with_overrides(self.scenario, {"seed": str(seed)})
            self._simulator = None
        if self._simulator is None:
            self._simulator = self._build()
            self.oracle = OracleSegmenter(Faults(self.scenario))
        self._pose_error = PoseError()
        self._paths = PathsPanel(self.intrinsics.width, self.intrinsics.height, ("estimate",))
        self._estimate: FloatArray | None = None
        self._result: FrameResult | None = None
        with one_opencv_thread():
            observation, info = self._begin()
        self._show()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, Info]:
        """Go on by a frame; see the environment's own page."""
        with one_opencv_thread():
            observation, terms, is_last, info = self._advance(action)
        info["reward"] = terms
        self._show()
        is_lost = self._pose_error.lost_frames >= self._lost_frames
        return observation, sum(terms.values()), is_lost, is_last, info

    def render(self) -> Picture | None:
        """Colour, depth, masks and trajectory side by side (H, 4 W, 3) in the mode `rgb_array`, else None."""
        return self._picture() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None

    @property
    def simulator(self) -> Simulator:
        """The world of this episode.

        Raises:
            RuntimeError: no episode has begun.
        """
        if self._simulator is None:
            raise RuntimeError("call reset first")
        return self._simulator

    def _build(self) -> Simulator:
        return build_simulator(self.scenario, self._renderer, self._threads)

    def _begin(self) -> tuple[Observation, Info]:
        """The first observation of an episode."""
        raise NotImplementedError

    def _advance(self, action: Action) -> tuple[Observation, dict[str, float], bool, Info]:
        """Next observation, terms of the reward, whether it was the scenario's last frame, and what else to tell."""
        raise NotImplementedError

    def _frame(self, index: int) -> tuple[RgbdFrame, GroundTruth]:
        """A frame and its truth, which is shown to the oracle."""
        frame = self.simulator.frame(index)
        self.oracle.show(index, frame.truth)
        return rgbd_frame_from_sim(frame), frame.truth

    def _loop(self, front_end: FrontEnd, feedback: PoseFeedback, T_world_camera: FloatArray) -> ClosedLoop:
        """The front end in a loop with embedded SLAM that starts at `T_world_camera` (4, 4)."""
        self._estimate = T_world_camera
        return ClosedLoop(front_end, EmbeddedSlam(self.intrinsics, T_world_camera), feedback, T_world_camera)

    def _run(self, loop: ClosedLoop, frame: RgbdFrame, truth: GroundTruth) -> tuple[FrameResult, float]:
        """What the loop makes of a frame, and the price of its pose error."""
        self._result = result = loop.step(frame)
        estimate = result.pose.T_world_camera
        if estimate is not None:
            self._estimate = estimate
        self._paths.add(truth.T_world_camera, {"estimate": result})
        return result, self._pose_error.price(truth.T_world_camera, estimate, self.weights)

    def _known(self) -> Info:
        """What every info holds.

        `estimated_pose` (4, 4): the last `T_world_camera` that SLAM gave; `is_tracked`: whether it is of this frame.
        """
        assert self._estimate is not None
        return {"estimated_pose": self._estimate.copy(), "is_tracked": self._pose_error.lost_frames == 0}

    def _picture(self) -> Picture:
        result = self._result
        if result is None:
            return np.zeros((self.intrinsics.height, 4 * self.intrinsics.width, 3), np.uint8)
        return side_by_side(
            [
                ("colour", colour_panel(result)),
                ("depth", depth_panel(result.frame.depth_m)),
                ("red: hidden from odometry", hidden_panel(result)),
                ("", self._paths.draw()),
            ]
        )

    def _show(self) -> None:
        if self.render_mode != "human":
            return
        if self._window is None:
            self._window = Window(f"dotmask: {self.scenario.name}", self.scenario.frame_rate_hz)
        self._window.show(self._picture())
