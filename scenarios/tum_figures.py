"""How long and how fast the camera moves: in the TUM RGB-D benchmark, and in the scenarios that follow it."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from scenarios.camera import camera_path
from scenarios.spec import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFigures:
    """The camera's motion over a whole sequence.

    Attributes:
        duration_s: from the first to the last pose.
        length_m: of the way.
        speed_m_s: mean.
        turn_deg_s: mean angular speed.
    """

    duration_s: float
    length_m: float
    speed_m_s: float
    turn_deg_s: float


def _figures(duration_s: float, length_m: float, speed_m_s: float, turn_deg_s: float) -> CameraFigures:
    return CameraFigures(duration_s=duration_s, length_m=length_m, speed_m_s=speed_m_s, turn_deg_s=turn_deg_s)


BENCHMARK: Mapping[str, CameraFigures] = MappingProxyType(
    {
        "fr2_desk": _figures(99.4, 18.88, 0.193, 6.3),
        "fr2_desk_with_person": _figures(142.1, 17.04, 0.121, 5.3),
        "fr3_long_office_household": _figures(87.1, 21.46, 0.249, 10.2),
        "fr3_sitting_static": _figures(23.6, 0.26, 0.011, 1.7),
        "fr3_sitting_xyz": _figures(42.5, 5.50, 0.132, 3.6),
        "fr3_sitting_rpy": _figures(27.5, 1.11, 0.042, 23.8),
        "fr3_sitting_halfsphere": _figures(37.2, 6.50, 0.180, 19.1),
        "fr3_walking_static": _figures(24.8, 0.28, 0.012, 1.4),
        "fr3_walking_xyz": _figures(28.8, 5.79, 0.208, 5.5),
        "fr3_walking_rpy": _figures(30.6, 2.70, 0.091, 20.9),
        "fr3_walking_halfsphere": _figures(35.8, 7.69, 0.221, 18.3),
    }
)
"""What the web page of the benchmark states for the sequence of that name: J. Sturm, N. Engelhard, F. Endres,
W. Burgard, D. Cremers, A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS 2012."""


def camera_figures(scenario: Scenario) -> CameraFigures:
    """The camera's motion in a scenario, from its poses at the frame rate."""
    path = camera_path(scenario)
    times = np.arange(scenario.frames) / scenario.frame_rate_hz
    poses = np.array([path.pose_at(float(time_s)) for time_s in times])
    length_m = float(np.sqrt(np.sum(np.diff(poses[:, :3, 3], axis=0) ** 2, axis=1)).sum())
    # The distance of two rotations as matrices is sqrt(8) times the sine of half the angle; small angles keep digits.
    chords = np.sqrt(np.sum(np.diff(poses[:, :3, :3], axis=0) ** 2, axis=(1, 2)))
    turned_deg = float(np.degrees(2 * np.arcsin(np.minimum(chords / np.sqrt(8.0), 1.0))).sum())
    duration_s = scenario.duration_s
    return CameraFigures(
        duration_s=duration_s,
        length_m=length_m,
        speed_m_s=length_m / duration_s,
        turn_deg_s=turned_deg / duration_s,
    )
