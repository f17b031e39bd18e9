"""Arms that hold something: hands at given places, shoulders and elbows by inverse kinematics.

A hand's frame has its origin at the wrist; unturned, in the root frame (facing -y, z up), the fingers point ahead, the
palm faces the other hand and the thumb is up.
"""

from math import sqrt

import numpy as np

from sim.geometry import FloatArray
from sim.people.kernels import cross, limb_frame, two_bones, unit
from sim.people.limbs import between, rotation_about, twist_angle
from sim.people.skeleton import Skeleton

_SIDES = ("Left", "Right")
_HAND_AHEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]).T
"""Columns of an unturned hand: the fingers, the thumb, their cross product."""

_ELBOW_TO = np.array([[0.45, 0.35, -1.0], [-0.45, 0.35, -1.0]])
"""(2, 3) to which side of the line from shoulder to wrist the elbows go: down, outward and back."""

TWIST_OF_FOREARM = 0.5
"""Share of the hand's turn about the forearm that the forearm takes, as ulna and radius do."""


class Arms:
    """The arms of a skeleton.

    Args:
        skeleton: has Arm, ForeArm and Hand on both sides; thumbs and fingers if it has any.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        heads = {name: skeleton.heads[i] for i, name in enumerate(skeleton.names)}
        self.upper_m, self.fore_m = [], []
        self._upper_frame, self._fore_frame, self._fore_axis, self._hand_frame = [], [], [], []
        for side in _SIDES:
            shoulder, elbow, wrist = (heads[side + bone] for bone in ("Arm", "ForeArm", "Hand"))
            upper, fore = elbow - shoulder, wrist - elbow
            self.upper_m.append(sqrt(upper @ upper))
            self.fore_m.append(sqrt(fore @ fore))
            hinge = cross(upper, fore)
            self._upper_frame.append(limb_frame(upper, hinge).T)
            self._fore_frame.append(limb_frame(fore, hinge).T)
            self._fore_axis.append(unit(fore))
            fingers, thumb = side + "FingerBase", side[0] + "Thumb"
            up = heads[thumb] - heads[fingers] if fingers in heads and thumb in heads else np.array([0.0, -0.5, 1.0])
            self._hand_frame.append(_HAND_AHEAD @ limb_frame(fore, up).T)

    def holding(
        self, side: int, shoulder: FloatArray, wrist: FloatArray, R_upper: FloatArray, R_fore: FloatArray, share: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rotations (3, 3) of upper arm, forearm and hand from rest.

        Args:
            side: 0 left, 1 right.
            shoulder: (3,) root frame.
            wrist: (4, 4) the hand's frame in the root frame.
            R_upper: (3, 3) the upper arm if it does not hold.
            R_fore: (3, 3) the forearm and hand if they do not hold.
            share: 0..1 of the way from there to the hand at `wrist`.
        """
        reach = wrist[:3, 3] - shoulder
        along = unit(reach)
        bend = unit(_ELBOW_TO[side] - (_ELBOW_TO[side] @ along) * along)
        elbow, end = two_bones(reach, self.upper_m[side], self.fore_m[side], bend)
        hinge = cross(elbow, end - elbow)
        upper = limb_frame(elbow, hinge) @ self._upper_frame[side]
        fore = limb_frame(end - elbow, hinge) @ self._fore_frame[side]
        hand = wrist[:3, :3] @ self._hand_frame[side]
        twist = twist_angle(hand @ fore.T, unit(end - elbow))
        fore = rotation_about(unit(end - elbow), TWIST_OF_FOREARM * twist) @ fore
        if share < 1.0:
            return between(R_upper, upper, share), between(R_fore, fore, share), between(R_fore, hand, share)
        return upper, fore, hand
