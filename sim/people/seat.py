"""Sitting down on a chair, and standing up: the feet stay, the hips go back and down, the trunk leans forward."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.people.body import Body
from sim.people.rows import ANKLES, ARMS, CHEST, HEAD, HIPS, PELVIS, standing_row
from sim.people.steps import STEP_S

HIP_OVER_SEAT_M = 0.112
"""Height of the hip joints of a sitting person over the seat."""

FEET_BACK_M = 0.03
"""The ankles of a sitting person are so far behind the place where the shins are upright."""

SIT_DOWN_S = 2.0
STAND_UP_S = 1.9

_LEAN_DEG = {"pelvis": 24.0, "chest": 36.0, "head": 14.0}
"""How far the trunk leans forward on the way, beyond standing and sitting."""

_SEATED_PELVIS_DEG, _SEATED_CHEST_DEG, _SEATED_HEAD_DEG = -10.0, 1.0, 3.0
_SEATED_ARM_DEG = (20.0, 4.0, 46.0, 12.0)
"""The hands lie on the thighs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """Where a person can sit.

    Attributes:
        position_world: (2,) metres, the point of the floor under the hips of who sits there.
        heading_rad: where it faces, from the world's x axis.
        height_m: of the seat's surface, 0.35 to 0.6.

    Raises:
        MotionError: nobody can sit at this height.
    """

    position_world: tuple[float, float]
    heading_rad: float
    height_m: float

    def __post_init__(self) -> None:
        """Refuse seats for giants and dwarfs."""
        if not 0.35 <= self.height_m <= 0.6:
            raise MotionError(f"height_m: people sit on 0.35 to 0.6 m, got {self.height_m}")

    @property
    def ahead(self) -> FloatArray:
        """(2,) unit vector to where it faces."""
        return np.array([np.cos(self.heading_rad), np.sin(self.heading_rad)])


def place_before(body: Body, seat: Seat) -> FloatArray:
    """(2,) metres in the world, where a person stands to sit down: above the feet of who sits."""
    return np.asarray(seat.position_world + _feet_ahead_m(body, seat) * seat.ahead)


def seated_row(body: Body, seat: Seat) -> FloatArray:
    """(COLUMNS,) a person who sits, hands in the lap; the root is under the hips."""
    row = standing_row(body, np.asarray(seat.position_world), seat.heading_rad)
    row[HIPS] = [0.0, 0.0, seat.height_m + HIP_OVER_SEAT_M - float(body.hip_offset[:, 2].mean())]
    row[ANKLES] += [0.0, -_feet_ahead_m(body, seat), 0.0] * 2
    row[PELVIS] = np.radians([0.0, 0.0, _SEATED_PELVIS_DEG])
    row[CHEST] = np.radians([0.0, 0.0, _SEATED_CHEST_DEG])
    row[HEAD] = np.radians([0.0, 0.0, _SEATED_HEAD_DEG])
    row[ARMS] = np.radians(_SEATED_ARM_DEG * 2)
    return row


def sitting_down_rows(body: Body, seat: Seat) -> FloatArray:
    """(n, COLUMNS) every STEP_S from standing at `place_before` to sitting."""
    return _rows(body, seat, np.linspace(0.0, 1.0, round(SIT_DOWN_S / STEP_S) + 1))


def standing_up_rows(body: Body, seat: Seat) -> FloatArray:
    """(n, COLUMNS) every STEP_S from sitting to standing at `place_before`."""
    return _rows(body, seat, np.linspace(1.0, 0.0, round(STAND_UP_S / STEP_S) + 1))


def _rows(body: Body, seat: Seat, share: npt.NDArray[np.float64]) -> FloatArray:
    """Rows at the shares (n,) of the way from standing (0) to sitting (1)."""
    standing = standing_row(body, place_before(body, seat), seat.heading_rad)
    done = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    rows = standing + done[:, None] * (seated_row(body, seat) - standing)
    leaning = np.sin(np.pi * share) ** 2
    for column, degrees in ((PELVIS, _LEAN_DEG["pelvis"]), (CHEST, _LEAN_DEG["chest"]), (HEAD, _LEAN_DEG["head"])):
        rows[:, column.stop - 1] += np.radians(degrees) * leaning
    return rows


def _feet_ahead_m(body: Body, seat: Seat) -> float:
    """How far the ankles of a sitting person are ahead of the root, which is under the root bone."""
    hip_height = seat.height_m + HIP_OVER_SEAT_M
    thigh, shin = float(body.thigh_m.mean()), float(body.shin_m.mean())
    drop = hip_height - float(body.ankle_rest[:, 2].mean()) - shin  # from hip to knee when the shin is upright
    ahead = float(np.sqrt(max(thigh**2 - drop**2, 0.0)))
    return ahead - float(body.hip_offset[:, 1].mean()) - FEET_BACK_M
