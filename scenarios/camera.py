"""The camera and its path, from a scenario."""

import math
from pathlib import Path
from types import MappingProxyType

import numpy as np

from scenarios.cast import build_cast
from scenarios.errors import unknown
from scenarios.spec import CameraSpec, FollowCameraSpec, IntrinsicsSpec, RobotCameraSpec, Scenario, TourCameraSpec
from sim.camera_paths.hand_held import HalfspherePath, RpyPath, StaticPath, XyzPath
from sim.camera_paths.path import CameraPath
from sim.camera_paths.recorded import RecordedPath, read_recorded
from sim.camera_paths.tour import Stop, TourPath
from sim.camera_paths.wheeled import FollowingPath, RobotPath
from sim.errors import CameraPathError
from sim.geometry import FloatArray, look_at
from sim.records import CameraModel

HAND_HELD_PATHS = MappingProxyType({"static": StaticPath, "xyz": XyzPath, "rpy": RpyPath, "halfsphere": HalfspherePath})


def camera_model(spec: IntrinsicsSpec) -> CameraModel:
    """The intrinsics and the exposure."""
    return CameraModel(
        width=spec.width,
        height=spec.height,
        fx=spec.fx,
        fy=spec.fy,
        cx=spec.cx,
        cy=spec.cy,
        exposure_ev=spec.exposure_ev,
    )


def camera_path(scenario: Scenario) -> CameraPath:
    """Where the camera is over time; the same in every variant of the scenario.

    Raises:
        ScenarioError: nobody has the name of the person to follow.
        SimError: a recorded trajectory cannot be replayed, or the path cannot be gone.
    """
    spec = scenario.camera
    if isinstance(spec, TourCameraSpec):
        return _tour(spec, scenario.seed)
    if isinstance(spec, RobotCameraSpec):
        return RobotPath(
            spec.waypoints_m,
            speed_m_s=spec.speed_m_s,
            height_m=spec.height_m,
            tilt_rad=math.radians(spec.tilt_deg),
            seed=scenario.seed,
            amplitude=spec.amplitude,
            speed=spec.speed,
        )
    if isinstance(spec, FollowCameraSpec):
        return _following(spec, scenario)
    if spec.trajectory is not None:
        return _replay(spec, spec.trajectory, scenario)
    return HAND_HELD_PATHS[spec.path](
        T_world_camera=_nominal_camera(spec),
        seed=scenario.seed,
        amplitude=spec.amplitude,
        speed=spec.speed,
        translation=spec.translation,
    )


def _nominal_camera(spec: CameraSpec) -> FloatArray:
    """`T_world_camera` (4, 4) in the middle of the path."""
    heading, tilt = math.radians(spec.heading_deg), math.radians(spec.tilt_deg)
    forward = (math.cos(heading) * math.cos(tilt), math.sin(heading) * math.cos(tilt), -math.sin(tilt))
    return look_at(spec.position_m, np.add(spec.position_m, forward))


def _tour(spec: TourCameraSpec, seed: int) -> TourPath:
    stops = [
        Stop(
            time_s=stop.time_s,
            position_world=stop.position_m,
            target_world=stop.look_at_m,
            roll_rad=math.radians(stop.roll_deg),
        )
        for stop in spec.stops
    ]
    return TourPath(stops, seed=seed, amplitude=spec.amplitude, speed=spec.speed)


def _following(spec: FollowCameraSpec, scenario: Scenario) -> FollowingPath:
    people = {person.name: person for person in build_cast(scenario)}
    if spec.person not in people:
        raise unknown("person for the camera to follow", spec.person, people)
    return FollowingPath(
        people[spec.person].motion,
        distance_m=spec.distance_m,
        height_m=spec.height_m,
        gaze_m=spec.gaze_m,
        duration_s=max(scenario.duration_s, 1.0),
        seed=scenario.seed,
        amplitude=spec.amplitude,
    )


def _replay(spec: CameraSpec, trajectory: str, scenario: Scenario) -> RecordedPath:
    path = RecordedPath.placed(
        read_recorded(Path(trajectory)),
        position_world=spec.position_m,
        heading_rad=math.radians(spec.heading_deg),
        speed=spec.speed,
    )
    if path.duration_s < scenario.duration_s:
        enough = int(path.duration_s * scenario.frame_rate_hz) + 1
        raise CameraPathError(
            f"{trajectory}: lasts {path.duration_s:.2f} s at speed {spec.speed:g}, but {scenario.frames} frames "
            f"need {scenario.duration_s:.2f} s; use --frames {enough} at most"
        )
    return path
