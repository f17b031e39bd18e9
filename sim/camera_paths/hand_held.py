"""Paths of a camera that is held by hand around one place, like those of the TUM RGB-D benchmark.

They follow the motions of the fr3 sequences (Sturm et al., A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS
2012) and match the mean speeds that the benchmark states for fr3/walking. They are sums of sines, hence smooth in
every derivative.
"""

import math
from dataclasses import dataclass

import numpy as np

from sim.camera_paths.path import check_factor, check_nominal, check_speed, rotation_from_vector
from sim.camera_paths.shake import hand_shake, sway
from sim.geometry import FloatArray, pose

HALFSPHERE_RADIUS_M = 0.5
HALFSPHERE_GAZE_M = 0.7
"""What the camera on the half sphere looks at lies this far before the nominal camera."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _HandHeldPath:
    """What the synthetic paths share.

    Attributes:
        T_world_camera: (4, 4) nominal pose, in the middle of the path.
        seed: of the path's phases.
        amplitude: factor on every offset and rotation; 1 is like the TUM sequence, 0 is a tripod.
        speed: the same path in 1/speed of the time; 1 is like the TUM sequence at amplitude 1.
        translation: a further factor on every offset, while the rotations stay.
    """

    T_world_camera: FloatArray
    seed: int = 0
    amplitude: float = 1.0
    speed: float = 1.0
    translation: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no path."""
        check_nominal(self.T_world_camera)
        check_speed(self.speed)
        check_factor("amplitude", self.amplitude)
        check_factor("translation", self.translation)

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4) at any time."""
        T_nominal_camera = self._T_nominal_camera(self.speed * time_s)
        T_nominal_camera[:3, 3] *= self.translation
        return np.asarray(self.T_world_camera @ T_nominal_camera)

    def _T_nominal_camera(self, time_s: float) -> FloatArray:
        """(4, 4) in the nominal camera's axes, at speed 1."""
        offset, rotation = self._offset(time_s)
        return pose(rotation_from_vector(self.amplitude * rotation), self.amplitude * offset)

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Offset (3,) in metres and rotation vector (3,) in radians at speed and amplitude 1."""
        return hand_shake(time_s, self.seed)


class StaticPath(_HandHeldPath):
    """Held still by hand: 0.012 m/s and 1.4 deg/s on average, like fr3/walking_static."""

    __slots__ = ()


class XyzPath(_HandHeldPath):
    """Moves along the camera's three axes by up to 0.5 m: 0.21 m/s and 5.5 deg/s, like fr3/walking_xyz."""

    __slots__ = ()

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        offset, rotation = hand_shake(time_s, self.seed)
        main = sway(time_s, self.seed, "xyz", (0.101, 0.113, 0.089), 0.017)
        tilt = sway(time_s, self.seed, "xyz tilt", (0.191, 0.163, 0.223), 0.041)
        return offset + np.array([0.48, 0.36, 0.42]) * main, rotation + np.array([0.104, 0.104, 0.082]) * tilt


class RpyPath(_HandHeldPath):
    """Turns about the camera's three axes by up to 0.44 rad: 0.091 m/s and 20.9 deg/s, like fr3/walking_rpy."""

    __slots__ = ()

    def _offset(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        offset, rotation = hand_shake(time_s, self.seed)
        main = sway(time_s, self.seed, "rpy", (0.193, 0.157, 0.211), 0.027)
        drift = sway(time_s, self.seed, "rpy drift", (0.171, 0.229, 0.149), 0.037)
        return offset + np.array([0.11, 0.085, 0.098]) * drift, rotation + np.array([0.30, 0.44, 0.40]) * main


class HalfspherePath(_HandHeldPath):
    """On a half sphere of one metre diameter: 0.221 m/s and 18.3 deg/s, like fr3/walking_halfsphere.

    The nominal pose is the sphere's pole, and the scene lies behind the sphere. The camera looks through the sphere at
    a point a little behind its centre, which gives the benchmark's ratio of 0.7 m between the two speeds.
    """

    __slots__ = ()

    def _T_nominal_camera(self, time_s: float) -> FloatArray:
        swing = sway(time_s, self.seed, "halfsphere", (0.173, 0.131, 0.191), 0.029)
        up, right = self.amplitude * 0.55 * float(swing[0]), self.amplitude * 1.0 * float(swing[1])
        radius = HALFSPHERE_RADIUS_M + self.amplitude * 0.02 * float(swing[2])
        outward = np.array([math.cos(up) * math.sin(right), -math.sin(up), -math.cos(up) * math.cos(right)])
        place = np.array([0.0, 0.0, HALFSPHERE_RADIUS_M]) + radius * outward
        forward = np.array([0.0, 0.0, HALFSPHERE_GAZE_M]) - place
        forward = forward / math.sqrt(float(np.sum(forward**2)))
        across = np.cross([0.0, 1.0, 0.0], forward)
        across = across / math.sqrt(float(np.sum(across**2)))
        looking = np.stack([across, np.cross(forward, across), forward], axis=1)
        offset, rotation = self._offset(time_s)
        return pose(looking @ rotation_from_vector(self.amplitude * rotation), place + self.amplitude * offset)
