"""`DotMask/CameraDrive-v0`: the agent drives the camera through a scenario, and a method is judged on what it sees."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from dotmask.evaluation.masks import count_masking
from dotmask.pipeline import FrameResult
from dotmask.profiles import profile as get_profile
from dotmask.records import FloatArray
from scenarios.camera import camera_path
from scenarios.envs.base import FARTHEST_M, Info, Observation, ScenarioEnv
from scenarios.envs.drive import Drive, DriveLimits, FreeSpace
from scenarios.envs.reward import Coverage
from scenarios.envs.tracks import tracks_observation, tracks_space
from scenarios.errors import ScenarioError, unknown
from scenarios.run import METHODS
from scenarios.spec import Scenario, StopSpec, TourCameraSpec
from scenarios.spec.camera import IntrinsicsSpec
from scenarios.world import ROOMS, build_simulator
from sim.camera_paths.driven import DrivenPath
from sim.geometry import look_at
from sim.records import GroundTruth
from sim.simulator import Simulator

TRACK_ROWS = 16
"""Tracks that an observation has room for."""

Twist = npt.NDArray[np.float32]


class CameraDrive(ScenarioEnv[Twist]):
    """Drive the camera: the world moves as the scenario says, the camera as the agent says, from the scenario's start.

    The action is a normalised twist in camera axes; see `Drive.step`. The room stops the camera, people do not. The
    spaces, the terms of the reward and the contents of `info` are tabled in docs/gym.md.

    Args:
        scenario: see `ScenarioEnv`.
        overrides: see `ScenarioEnv`.
        method: of `scenarios.run.METHODS`, what masks the depth for SLAM.
        profile: name of the method's parameters.
        limits: of the camera's motion.
        **shared: see `ScenarioEnv`.

    Raises:
        ScenarioError: what is asked for does not exist, or the sensor looks ahead of the frame's time.
        ProfileError: no such profile.
    """

    def __init__(
        self,
        scenario: str | Scenario = "smoke",
        overrides: Mapping[str, Any] | None = None,
        *,
        method: str = "dotmask",
        profile: str = "calibrated",
        limits: DriveLimits | None = None,
        **shared: Any,
    ) -> None:
        super().__init__(scenario, overrides, **shared)
        if method not in METHODS:
            raise unknown("method", method, METHODS)
        if self.scenario.sensor.motion_errors:
            raise ScenarioError(
                f"{self.scenario.name}: a driven camera has no future to expose over; use sensor.motion_errors=false"
            )
        self._method, self._profile = method, get_profile(profile)
        self.limits = limits or DriveLimits()
        images, size = self.image_spaces(), (self.intrinsics.height, self.intrinsics.width)
        self.action_space = spaces.Box(-1, 1, (6,), np.float32)
        self.observation_space = spaces.Dict(
            {
                **images,
                "mdi": spaces.Box(0, FARTHEST_M, size, np.float32),
                "mo_mdi": spaces.Box(0, FARTHEST_M, size, np.float32),
                "tracks": tracks_space(TRACK_ROWS),
                "estimated_pose": spaces.Box(-FARTHEST_M, FARTHEST_M, (4, 4), np.float64),
                "is_tracked": spaces.MultiBinary(1),
                "twist": spaces.Box(-1, 1, (6,), np.float32),
            }
        )

    def driven_scenario(self) -> Scenario:
        """The scenario with the camera as it was driven in this episode: `dotmask run --from` repeats its frames.

        The camera is a tour with a stop at every capture, and without a hand that shakes.
        """
        intrinsics = {name: getattr(self.scenario.camera, name) for name in IntrinsicsSpec.model_fields}
        poses = self._path.poses
        camera = TourCameraSpec(**intrinsics, stops=_stops(poses, self.scenario.frame_rate_hz), amplitude=0.0)
        return self.scenario.model_copy(update={"camera": camera, "frames": len(poses)})

    def _build(self) -> Simulator:
        start = camera_path(self.scenario).pose_at(0.0)
        self._path = DrivenPath(start, self.scenario.frame_rate_hz)
        self._space = FreeSpace(ROOMS[self.scenario.room](self.scenario.seed).obstacles)
        return build_simulator(self.scenario, self._renderer, self._threads, self._path)

    def _begin(self) -> tuple[Observation, Info]:
        self._path.restart()
        self._drive = Drive(self.limits, self._space, self._path.pose_at(0.0))
        self._coverage = Coverage(self.intrinsics, tuple(a.instance_id for a in self.simulator.scene.actors))
        self._index = 0
        frame, truth = self._frame(0)
        self._closed_loop = self._loop(
            METHODS[self._method](self.oracle, self._profile), self._profile.pose_feedback, truth.T_world_camera
        )
        result, _ = self._run(self._closed_loop, frame, truth)
        self._coverage.see(truth)
        return self._observation(result), self._told(truth)

    def _advance(self, action: Twist) -> tuple[Observation, dict[str, float], bool, Info]:
        command = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._index += 1
        # Between two delivered frames may lie captures that the sensor lost: the camera moves on in them.
        captures = round(self.simulator.time_s(self._index) * self.scenario.frame_rate_hz) + 1
        blocked = False
        while len(self._path) < captures:
            self._path.append(self._drive.step(command, 1.0 / self.scenario.frame_rate_hz))
            blocked = blocked or self._drive.is_blocked
        frame, truth = self._frame(self._index)
        result, error = self._run(self._closed_loop, frame, truth)
        terms = {
            "relative_pose_error": -error,
            "leak": -self.weights.leak * _leak(truth, result),
            "progress": self.weights.progress_per_m2 * self._coverage.see(truth),
        }
        info = {**self._told(truth), "is_blocked": blocked}
        return self._observation(result), terms, self._index + 1 == len(self.simulator), info

    def _told(self, truth: GroundTruth) -> Info:
        return {**self._known(), "true_pose": truth.T_world_camera.copy()}

    def _observation(self, result: FrameResult) -> Observation:
        known = self._known()
        return {
            **self.images(result.frame),
            "mdi": result.front_end.masked.mdi_m.copy(),
            "mo_mdi": result.front_end.masked.mo_mdi_m.copy(),
            "tracks": tracks_observation(result.front_end.tracks, TRACK_ROWS),
            "estimated_pose": np.clip(known["estimated_pose"], -FARTHEST_M, FARTHEST_M),
            "is_tracked": np.array([known["is_tracked"]], np.int8),
            "twist": np.clip(self._drive.twist(), -1, 1).astype(np.float32),
        }


def _leak(truth: GroundTruth, result: FrameResult) -> float:
    """Share of the moving objects' pixels that odometry sees; 0 without such pixels."""
    moving = [actor.instance_id for actor in truth.objects if actor.is_moving]
    counts = count_masking(result.frame.depth_m, result.front_end.masked.mo_mdi_m, truth.instance_ids, moving)
    return counts.leak or 0.0


def _stops(poses: FloatArray, frame_rate_hz: float) -> tuple[StopSpec, ...]:
    """A stop for each pose (N, 4, 4), a frame apart; one that never moved gets a second stop at the same place."""
    if len(poses) == 1:
        poses = np.concatenate([poses, poses])
    rolls = []
    for T_world_camera in poses:
        upright = look_at(T_world_camera[:3, 3], T_world_camera[:3, 3] + T_world_camera[:3, 2])[:3, :3]
        rolled = upright.T @ T_world_camera[:3, :3]
        rolls.append(math.atan2(rolled[1, 0], rolled[0, 0]))
    return tuple(
        StopSpec(
            time_s=number / frame_rate_hz,
            position_m=tuple(map(float, T_world_camera[:3, 3])),
            look_at_m=tuple(map(float, T_world_camera[:3, 3] + T_world_camera[:3, 2])),
            roll_deg=math.degrees(roll),
        )
        for number, (T_world_camera, roll) in enumerate(zip(poses, np.unwrap(rolls), strict=True))
    )
