"""Where the hands are: at the back of a chair that is pushed, at a cup or a box that is carried."""

from dataclasses import dataclass
from math import pi, radians

import numpy as np

from sim.geometry import FloatArray, pose, rotation_z
from sim.people.body import Body, Posture
from sim.people.kernels import rotation
from sim.people.rows import posture_from_row, standing_row

PUSH_BEHIND_AXIS_M = 0.33
"""The hands of who pushes a chair are so far behind its axis: at the rear face of its back, near its upper edge."""

PUSH_HEIGHT_M = 0.99
PUSH_HALF_WIDTH_M = 0.14
PUSH_AHEAD_M = 0.44
"""Of the hands: height (3 cm below the edge of an office chair), half their distance, how far ahead of the root."""

PUSH_LEAN_RAD = radians(19.0)
"""How far the trunk leans forward to push."""

_PUSH_HAND_UP_RAD = radians(20.0)
_WRIST_TO_PALM_M = (0.065, 0.022)
"""From the wrist to the middle of the palm: along the fingers, and out of the palm."""

_CUP_RADIUS_M, _CUP_HELD_ABOVE_FOOT_M = 0.04, 0.05
_CUP_HAND_INWARD_RAD = radians(28.0)
_BELLY_M = 0.20
_BOX_DROP_SHARE = 0.62


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grip:
    """How a person holds a thing.

    Attributes:
        foot: (3,) root frame of a person at ease, the foot of the thing.
        wrists: (2, 4, 4) frames of the hands in that root frame.
        held: (2,) 1 for each hand that holds.
        shoulders: (3,) the middle between the shoulders then; the thing moves with it.
    """

    foot: FloatArray
    wrists: FloatArray
    held: FloatArray
    shoulders: FloatArray

    def shift(self, body: Body, posture: Posture) -> FloatArray:
        """(3,) how far the thing is from its place at ease, in the root frame: as far as the shoulders."""
        return np.asarray(body.shoulders(posture).mean(axis=0) - self.shoulders)


def cup_grip(body: Body) -> Grip:
    """A cup in the right hand, the forearm level."""
    shoulders = _shoulders_at_ease(body)
    wrist = shoulders[1] + [0.01, -0.86 * body.arms.fore_m[1], -0.97 * body.arms.upper_m[1]]
    hand = rotation_z(_CUP_HAND_INWARD_RAD)
    along, out = _WRIST_TO_PALM_M
    foot = wrist + hand @ [out + _CUP_RADIUS_M, -along - 0.015, -_CUP_HELD_ABOVE_FOOT_M]
    return Grip(
        foot=foot,
        wrists=np.stack([np.eye(4), pose(hand, wrist)]),
        held=np.array([0.0, 1.0]),
        shoulders=shoulders.mean(axis=0),
    )


def box_grip(body: Body, size_m: tuple[float, float, float]) -> Grip:
    """A box before the belly, held at its sides with both hands.

    Args:
        body: of the person.
        size_m: width (across the person), depth and height.
    """
    width, depth, height = size_m
    shoulders = _shoulders_at_ease(body)
    middle = shoulders.mean(axis=0)
    drop = _BOX_DROP_SHARE * (body.arms.upper_m[0] + body.arms.fore_m[0])
    centre = np.array([0.0, -_BELLY_M - depth / 2, middle[2] - drop])
    along, out = _WRIST_TO_PALM_M
    wrists = [pose(np.eye(3), centre + np.array([side * (width / 2 + out), along, 0.0])) for side in (1.0, -1.0)]
    return Grip(
        foot=centre - [0.0, 0.0, height / 2],
        wrists=np.stack(wrists),
        held=np.ones(2),
        shoulders=middle,
    )


def push_palms() -> FloatArray:
    """(2, 3) root frame, where the palms of who pushes a chair are."""
    return np.array([[side * PUSH_HALF_WIDTH_M, -PUSH_AHEAD_M, PUSH_HEIGHT_M] for side in (1.0, -1.0)])


def push_wrists() -> FloatArray:
    """(2, 4, 4) frames of the hands in the root frame: palms on the upper edge of the back, fingers over it."""
    along, out = _WRIST_TO_PALM_M
    frames = []
    for palm in push_palms():
        outward = float(np.sign(palm[0]))
        R_hand = rotation(0.0, 0.0, -_PUSH_HAND_UP_RAD) @ rotation(0.0, -outward * pi / 2, 0.0)
        frames.append(pose(R_hand, palm - R_hand @ [-outward * out, -along, 0.0]))
    return np.stack(frames)


def _shoulders_at_ease(body: Body) -> FloatArray:
    """(2, 3) in the root frame."""
    return body.shoulders(posture_from_row(standing_row(body, np.zeros(2), 0.0)))
