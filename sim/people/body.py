"""A person's body: from a posture to the matrices of all bones, with the feet exactly where they are asked to be.

Angles are in radians and measured as in a gait laboratory: flexion of the shoulder and elbow moves the limb
forward, the pitch of a foot is its angle to the floor (toes up positive), a tilt of pelvis, chest or head leans it
forward, a list lowers its left side, a yaw turns it to the left.
"""

from dataclasses import dataclass, field
from math import cos, radians, sin, tanh
from typing import Self

import numpy as np
import numpy.typing as npt

from sim.errors import MotionError
from sim.geometry import FloatArray
from sim.people.arms import Arms
from sim.people.characters import Character
from sim.people.limbs import cross, limb_frame, shortest_rotation, two_bones, unit
from sim.people.skeleton import Skeleton

SIDES = ("Left", "Right")
"""Order of everything that exists twice."""

TOE_BEND_RAD = radians(30.0)
"""How far the toes bend up at most when the heel rises."""

ROLL_RANGE_DEG = (-80.0, 45.0)
ROLL_STEP_DEG = 0.25
CONTACT_SOFTNESS_M = 0.001

_TRUNK_SHARE = {("Hips", "LHipJoint", "RHipJoint"): 0.0, ("LowerBack",): 0.34, ("Spine",): 0.67}
_NECK_SHARE = {("Neck",): 0.4, ("Neck1",): 0.75, ("Head",): 1.0}
"""How far bones go with the chest, and with the head; those of one share turn alike."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Soles:
    """The vertices under both feet, which must neither slide nor sink into the floor.

    Attributes:
        points: (n, 3) metres, at rest in the body frame.
        bones: (n, k) bone indices.
        weights: (n, k) bone weights, rows sum to 1.
    """

    points: FloatArray
    bones: npt.NDArray[np.int64]
    weights: FloatArray

    @classmethod
    def of(cls, character: Character) -> Self:
        """Those of a character, gathered from all its surfaces."""
        points, bones, weights = [], [], []
        for surface, indices in zip(character.surfaces, character.soles, strict=True):
            assert surface.bones is not None
            assert surface.weights is not None
            points.append(surface.vertices[indices])
            bones.append(surface.bones[indices])
            weights.append(surface.weights[indices])
        return cls(
            points=np.concatenate(points).astype(np.float64),
            bones=np.concatenate(bones).astype(np.int64),
            weights=np.concatenate(weights).astype(np.float64),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posture:
    """What a body does at one moment, in its root frame (on the floor, z up, facing -y, +x left).

    Attributes:
        hips: (3,) metres, where the root bone is.
        pelvis, chest, head: (3,) yaw, list and tilt against the root frame.
        shoulders: (2, 2) flexion and abduction of the left and right upper arm against the chest.
        elbows: (2, 2) flexion, and how far the forearm turns inward about the upper arm.
        ankles: (2, 3) metres, positions of the left and right ankle joint.
        foot_yaw: (2,) how far each foot turns to the left.
        foot_pitch: (2,) toes up positive; the toes bend by themselves when the heel rises.
        wrists: (2, 4, 4) where the hands are held, see `sim.people.arms`; None: nowhere, the arms follow their angles.
        held: (2,) 0..1, how far each arm leaves its angles for `wrists`.
    """

    hips: FloatArray
    ankles: FloatArray
    pelvis: FloatArray = field(default_factory=lambda: np.zeros(3))
    chest: FloatArray = field(default_factory=lambda: np.zeros(3))
    head: FloatArray = field(default_factory=lambda: np.zeros(3))
    shoulders: FloatArray = field(default_factory=lambda: np.zeros((2, 2)))
    elbows: FloatArray = field(default_factory=lambda: np.full((2, 2), 0.0))
    foot_yaw: FloatArray = field(default_factory=lambda: np.zeros(2))
    foot_pitch: FloatArray = field(default_factory=lambda: np.zeros(2))
    wrists: FloatArray | None = None
    held: FloatArray = field(default_factory=lambda: np.zeros(2))


def toe_pitch(foot_pitch: float) -> float:
    """Pitch of the toes: they stay on the floor while the heel rises, until they cannot bend further."""
    return foot_pitch - TOE_BEND_RAD * tanh(min(foot_pitch, 0.0) / TOE_BEND_RAD)


def rotation(yaw: float, lean: float, tilt: float) -> FloatArray:
    """3x3: a turn by `yaw` about z, after a list about y, after a tilt about x; scalars."""
    cz, sz, cy, sy, cx, sx = cos(yaw), sin(yaw), cos(lean), sin(lean), cos(tilt), sin(tilt)
    first = cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx
    second = sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx
    return np.array((*first, *second, -sy, cy * sx, cy * cx)).reshape(3, 3)  # from nested rows it takes twice as long


class Body:
    """A skeleton that can be posed.

    Raises:
        MotionError: the skeleton lacks a bone, or no sole point belongs to a foot.
    """

    def __init__(self, skeleton: Skeleton, soles: Soles) -> None:
        self.skeleton = skeleton
        required = [s + b for s in SIDES for b in ("UpLeg", "Leg", "Foot", "ToeBase", "Arm", "ForeArm", "Hand")]
        missing = sorted({"Hips", "Head", *required} - set(skeleton.names))
        if missing:
            raise MotionError(f"the skeleton cannot walk: it has no bones {missing}")
        heads = {name: skeleton.heads[i] for i, name in enumerate(skeleton.names)}
        self._bone = {name: i for i, name in enumerate(skeleton.names)}
        self._trunk_bones, self._neck_bones = (
            [([self._bone[name] for name in names if name in self._bone], share) for names, share in shares.items()]
            for shares in (_TRUNK_SHARE, _NECK_SHARE)
        )
        self.hips_rest = heads["Hips"]
        self.hip_offset = np.array([heads[s + "UpLeg"] - heads["Hips"] for s in SIDES])
        """(2, 3) from the root bone to the hip joints."""
        thigh = [heads[s + "Leg"] - heads[s + "UpLeg"] for s in SIDES]
        shin = [heads[s + "Foot"] - heads[s + "Leg"] for s in SIDES]
        self.thigh_m = np.linalg.norm(thigh, axis=1)
        self.shin_m = np.linalg.norm(shin, axis=1)
        self.leg_m = float(np.min(self.thigh_m + self.shin_m))
        """Hip to ankle with a straight knee, of the shorter leg."""
        self._thigh_frame = [limb_frame(v, np.array([1.0, 0.0, 0.0])).T for v in thigh]
        self._shin_frame = [limb_frame(v, np.array([1.0, 0.0, 0.0])).T for v in shin]
        self.arms = Arms(skeleton)
        self._arm_down = [self._hanging(side, sign) for side, sign in zip(SIDES, (1.0, -1.0), strict=True)]
        hand = ("{0}Hand", "{1}Thumb", "{0}FingerBase", "{0}HandFinger1")
        self._hand = {
            side: [self._bone[n] for n in (part.format(side, side[0]) for part in hand) if n in self._bone]
            for side in SIDES
        }
        self.ankle_rest = np.array([heads[s + "Foot"] for s in SIDES])
        toes = np.array([heads[s + "ToeBase"] for s in SIDES])
        ahead = (toes - self.ankle_rest)[:, :2]
        self.foot_ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        """(2, 2) horizontal direction in which each foot points at rest."""
        self._splay = np.arctan2(self.foot_ahead[:, 0], -self.foot_ahead[:, 1])
        self._unsplayed = [rotation(-splay, 0.0, 0.0) for splay in self._splay]
        self._roll_angles = np.radians(np.arange(ROLL_RANGE_DEG[0], ROLL_RANGE_DEG[1] + 1e-9, ROLL_STEP_DEG))
        self._roll = np.array([self._rolling(side, soles) for side in range(2)])

    # ---- feet ------------------------------------------------------------------------------------

    def foot_rotation(self, side: int, yaw: float, pitch: float) -> FloatArray:
        """3x3 of a foot (or its toes) that turns by `yaw` and pitches about its own cross axis."""
        splay = self._splay[side]
        return rotation(yaw + splay, 0.0, -pitch) @ self._unsplayed[side]

    def rolled_ankle(self, side: int, pitch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where the ankle goes when the foot rolls on the floor without sliding: forward and up, metres.

        At pitch 0 the foot stands flat: forward is 0, up is the ankle's height at rest.
        """
        forward, up = self._roll[side]
        return np.interp(pitch, self._roll_angles, forward), np.interp(pitch, self._roll_angles, up)

    def _rolling(self, side: int, soles: Soles) -> FloatArray:
        """(2, n) forward and up of the ankle for every angle of the table.

        The sole rolls over heel or toes in small steps. In each step the points that touch the floor stay where
        they are (a soft choice of the lowest points), and the lowest point is put on the floor.
        """
        foot, toe = self._bone[SIDES[side] + "Foot"], self._bone[SIDES[side] + "ToeBase"]
        on_foot = np.sum(soles.weights * np.isin(soles.bones, (foot, toe)), axis=1) > 0.5
        if not on_foot.any():
            raise MotionError(f"no sole point belongs to the {SIDES[side]} foot")
        points = soles.points[on_foot]
        toe_weight = np.sum(soles.weights[on_foot] * (soles.bones[on_foot] == toe), axis=1)[:, None]
        ankle, joint = self.ankle_rest[side], self.skeleton.heads[toe]
        ahead = self.foot_ahead[side]

        def sole_at(pitch: float) -> FloatArray:  # (n, 2) forward and up, seen from the ankle
            R_foot = self.foot_rotation(side, 0.0, pitch)
            R_toe = self.foot_rotation(side, 0.0, toe_pitch(pitch))
            by_foot = (points - ankle) @ R_foot.T
            by_toe = (points - joint) @ R_toe.T + R_foot @ (joint - ankle)
            posed = (1.0 - toe_weight) * by_foot + toe_weight * by_toe
            return np.stack([posed[:, :2] @ ahead, posed[:, 2]], axis=1)

        shapes = [sole_at(float(angle)) for angle in self._roll_angles]
        up = np.array([-shape[:, 1].min() for shape in shapes])
        touch = [np.exp(-(s[:, 1] + u) / CONTACT_SOFTNESS_M) for s, u in zip(shapes, up, strict=True)]
        step = np.zeros(len(shapes))
        for i in range(1, len(shapes)):
            weight = touch[i - 1] + touch[i]
            step[i] = -np.sum(weight * (shapes[i][:, 0] - shapes[i - 1][:, 0])) / np.sum(weight)
        forward = np.cumsum(step)
        flat = int(np.argmin(np.abs(self._roll_angles)))
        return np.stack([forward - forward[flat], up])

    # ---- the whole body --------------------------------------------------------------------------

    def palette(self, posture: Posture) -> FloatArray:
        """(B, 4, 4) skinning matrices from the rest frame into the root frame of `posture`."""
        bone = self._bone
        R = self._trunk(posture)
        R_chest, R_pelvis = rotation(*posture.chest.tolist()), rotation(*posture.pelvis.tolist())
        shoulders, elbows = posture.shoulders.tolist(), posture.elbows.tolist()
        foot_yaws, foot_pitches = posture.foot_yaw.tolist(), posture.foot_pitch.tolist()
        for side, name in enumerate(SIDES):
            outward = 1.0 - 2.0 * side
            upper, fore = self._arm_down[side]
            (flexion, abduction), (elbow, inward) = shoulders[side], elbows[side]
            yaw, pitch = foot_yaws[side], foot_pitches[side]
            R_shoulder = R_chest @ rotation(0.0, -outward * abduction, -flexion)
            R_elbow = R_shoulder @ rotation(-outward * inward, 0.0, -elbow)
            R[bone[name + "Arm"]] = R_shoulder @ upper
            R[bone[name + "ForeArm"]] = R[self._hand[name]] = R_elbow @ fore
            if posture.wrists is not None and posture.held[side] > 0.0:
                shoulder = posture.hips + self.skeleton.offset(R, name + "Arm")
                hand = self._hand[name]
                R[bone[name + "Arm"]], R[bone[name + "ForeArm"]], R[hand] = self.arms.holding(
                    side, shoulder, posture.wrists[side], R[bone[name + "Arm"]], R_elbow @ fore, posture.held[side]
                )
            hip = posture.hips + R_pelvis @ self.hip_offset[side]
            knee_yaw = 0.5 * (float(posture.pelvis[0]) + yaw)
            R_thigh, R_shin = self._leg(side, hip, posture.ankles[side], knee_yaw)
            R[bone[name + "UpLeg"]], R[bone[name + "Leg"]] = R_thigh, R_shin
            R[bone[name + "Foot"]] = self.foot_rotation(side, yaw, pitch)
            R[bone[name + "ToeBase"]] = self.foot_rotation(side, yaw, toe_pitch(pitch))
        return self.skeleton.palette(R, posture.hips)

    def shoulders(self, posture: Posture) -> FloatArray:
        """(2, 3) the shoulder joints in the root frame."""
        R = self._trunk(posture)
        return np.asarray(posture.hips + np.array([self.skeleton.offset(R, side + "Arm") for side in SIDES]))

    def _trunk(self, posture: Posture) -> FloatArray:
        """(B, 3, 3) how far each bone of the trunk, neck and head has turned; the limbs' bones as the chest."""
        R = np.empty((len(self.skeleton.names), 3, 3))
        R[:] = rotation(*posture.chest.tolist())
        for bones, share in self._trunk_bones:
            R[bones] = rotation(*(posture.pelvis + share * (posture.chest - posture.pelvis)).tolist())
        for bones, share in self._neck_bones:
            R[bones] = rotation(*(posture.chest + share * (posture.head - posture.chest)).tolist())
        return R

    def _leg(self, side: int, hip: FloatArray, ankle: FloatArray, knee_yaw: float) -> tuple[FloatArray, FloatArray]:
        """Rotations of thigh and shin that bring the ankle to its place: two-bone inverse kinematics, knee ahead."""
        reach = ankle - hip
        along = unit(reach)
        left = unit(cross(np.array([sin(knee_yaw), -cos(knee_yaw), 0.0]), along))
        # A posture out of reach is a fault of whoever made it; the leg is then straight and points at the ankle.
        knee, end = two_bones(reach, float(self.thigh_m[side]), float(self.shin_m[side]), cross(along, left))
        R_thigh = limb_frame(knee, left) @ self._thigh_frame[side]
        R_shin = limb_frame(end - knee, left) @ self._shin_frame[side]
        return R_thigh, R_shin

    def _hanging(self, side: str, outward: float) -> tuple[FloatArray, FloatArray]:
        """Rotations of upper arm and forearm from rest to hanging beside the body."""
        shoulder, elbow, wrist = (self.skeleton.heads[self._bone[side + b]] for b in ("Arm", "ForeArm", "Hand"))
        upper = shortest_rotation(elbow - shoulder, np.array([outward * 0.10, 0.02, -1.0]))
        fore = shortest_rotation(upper @ (wrist - elbow), np.array([outward * 0.03, -0.05, -1.0])) @ upper
        return upper, fore
