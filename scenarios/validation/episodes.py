"""Episodes in which everything that the filter assumes is so: motion, measurement, camera pose and sensor noise."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from dotmask.evaluation.filter import BeliefSample
from dotmask.profiles import ClassModel, Profile
from dotmask.records import Detections, FloatArray, Observation, RgbdFrame
from dotmask.tracking.ekf import initiate, update
from dotmask.tracking.measurement import observe
from dotmask.tracking.motion_model import predict
from scenarios.validation.exact import Shape, Statistic, placed, window_around
from sim.geometry import look_at
from sim.randomness import child
from sim.records import CameraModel
from sim.sensor.model import SensorModel

FRAME_RATE_HZ = 30.0

BALL = ClassModel(
    name="ball", acceleration_sigma_m_s2=1.0, prior_speed_sigma_m_s=0.5, speed_threshold_m_s=0.1, vertical_share=0.5
)
"""A rigid thing: what is measured of it strays by the sensor's noise alone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """One frame of an episode.

    Attributes:
        frame: the images of the window around the object.
        detections: the object, with its exact mask.
        T_world_camera: (4, 4) what the tracker is told.
    """

    frame: RgbdFrame
    detections: Detections
    T_world_camera: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Episode:
    """One object seen by a moving camera.

    Attributes:
        seed: that it was drawn from.
        looks: the frames.
        states: (T, 6) true position (of the ideal observation) and velocity, world.
    """

    seed: int
    looks: tuple[Look, ...]
    states: FloatArray


def random_states(model: ClassModel, start_world: FloatArray, frames: int, seed: int) -> FloatArray:
    """(frames, 6) drawn from the filter's own prior and motion model: a random acceleration, constant over a frame."""
    rng = child(seed, "validation", "motion")
    dt = 1.0 / FRAME_RATE_HZ
    state = np.concatenate([start_world, rng.normal(size=3) * model.prior_speed_sigma_m_s * model.axis_shares])
    states = [state]
    for _ in range(frames - 1):
        a = rng.normal(size=3) * model.acceleration_sigma_m_s2 * model.axis_shares
        state = np.concatenate([state[:3] + dt * state[3:] + 0.5 * dt**2 * a, state[3:] + dt * a])
        states.append(state)
    return np.array(states)


def record(
    shape: Shape,
    statistic: Statistic,
    model: ClassModel,
    sensor: SensorModel,
    frames: int,
    seed: int,
    pose_sigmas: tuple[float, float] = (0.0, 0.0),
) -> Episode:
    """An episode whose ideal observations move as the filter assumes.

    The camera goes along with the object, sways by half a metre and pans so that the image of the object moves by some
    pixels from frame to frame, distances lie between 1.2 and 3.2 m.

    Args:
        shape: the object.
        statistic: whose ideal observation is the truth.
        model: of the object's class.
        sensor: the errors of the depth image.
        frames: number of frames.
        seed: of everything random.
        pose_sigmas: of the camera's position (m) and rotation (rad), each axis: errors of the pose that the tracker is
            told, new in every frame.
    """
    states = random_states(model, np.array([0.0, 0.0, 1.0]), frames, seed)
    rng = child(seed, "validation", "camera")
    rates_hz, phases = rng.uniform(0.2, 0.7, 5), rng.uniform(0, 2 * np.pi, 5)
    distance_m = rng.uniform(1.7, 2.7)
    pose_rng = child(seed, "validation", "pose")
    looks = []
    for index, state in enumerate(states):
        time_s = index / FRAME_RATE_HZ
        sway = np.sin(2 * np.pi * rates_hz * time_s + phases)
        eye = np.add(state[:3], (0.5 * sway[0], -distance_m + 0.4 * sway[1], 0.3 * sway[2]))
        T_world_camera = look_at(eye, state[:3])
        T_world_camera[:3, :3] @= Rotation.from_euler("yx", (0.2 * sway[3], 0.15 * sway[4])).as_matrix()
        ideal_camera = T_world_camera[:3, :3].T @ (state[:3] - T_world_camera[:3, 3])
        place = placed(shape, ideal_camera, statistic)
        window = window_around(shape, place)
        images = shape.render(place, window)
        camera = CameraModel(
            width=window.width, height=window.height, fx=window.fx, fy=window.fy, cx=window.cx, cy=window.cy
        )
        rgb, depth_m = sensor.measure(images, camera, seed, index)
        mask = images.instance_ids > 0
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        detections = Detections(
            masks=mask[None],
            boxes_px=np.array([[columns[0], rows[0], columns[-1], rows[-1]]], np.float64),
            class_names=(model.name,),
            scores=np.ones(1),
        )
        frame = RgbdFrame(index=index, timestamp_s=time_s, rgb=rgb, depth_m=depth_m, intrinsics=window)
        shift, turn = pose_sigmas[0] * pose_rng.normal(size=3), pose_sigmas[1] * pose_rng.normal(size=3)
        told = T_world_camera.copy()
        told[:3, 3] += T_world_camera[:3, :3] @ shift
        told[:3, :3] @= Rotation.from_rotvec(turn).as_matrix()
        looks.append(Look(frame=frame, detections=detections, T_world_camera=told))
    return Episode(seed=seed, looks=tuple(looks), states=states)


def follow(
    episode: Episode, profile: Profile, adjust: Callable[[Observation], Observation]
) -> tuple[BeliefSample, ...]:
    """The beliefs of the filter from the second frame on: observe, initiate, then predict and update in every frame.

    Args:
        episode: the frames.
        profile: parameters.
        adjust: changes each observation before the filter sees it, to try other R.
    """
    track, samples = None, []
    for look, truth in zip(episode.looks, episode.states, strict=True):
        [observation] = observe(look.detections, look.frame, profile)
        observation, time_s = adjust(observation), look.frame.timestamp_s
        if track is None:
            track = initiate(observation, time_s, look.T_world_camera, profile, 1)
            continue
        track = update(predict(track, time_s, profile), observation, None, look.T_world_camera, profile)
        samples.append(
            BeliefSample(
                frame=look.frame.index,
                track_id=episode.seed,
                instance_id=episode.seed,
                mean=track.mean,
                covariance=track.covariance,
                innovation=track.innovation,
                centre_world=truth[:3],
                velocity_world=truth[3:],
                ideal_world=truth[:3],
                T_world_camera=look.T_world_camera,
            )
        )
    return tuple(samples)


def rigid(profile: Profile, pose_sigmas: tuple[float, float] = (0.0, 0.0)) -> Profile:
    """`profile` for balls, with a camera pose as uncertain as `pose_sigmas` (see `record`)."""
    noise = replace(profile.noise, pose_position_sigma_m=pose_sigmas[0], pose_rotation_sigma_rad=pose_sigmas[1])
    return replace(profile, classes=(BALL,), noise=noise)
