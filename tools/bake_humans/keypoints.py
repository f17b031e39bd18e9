"""The 17 COCO keypoints of a body at rest."""

import numpy as np

from tools.bake_humans.body import BODY_VERTICES, Body
from tools.bake_humans.mesh import Array

JOINTS = ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")
"""The bones that begin at shoulder, elbow, wrist, hip, knee and ankle."""
EAR_HOLE = 12108
"""The vertex of the MakeHuman base mesh at the bottom of the left ear's shell."""


def keypoints(body: Body) -> tuple[Array, Array, Array]:
    """Points (17, 3), bones (17, 4) and weights (17, 4) in COCO's order.

    The face is rigid in the head: the tip of the nose, the pupils and the ear holes. The other twelve are the joints
    of the skeleton, where their bone begins, so they do not depend on how the skin blends.
    """
    pupil = body.eye() - [0.0, body.eye_radius(), 0.0]
    mirror = np.array([-1.0, 1.0, 1.0])
    ear = body.vertices[EAR_HOLE]
    face = [nose_tip(body), pupil, pupil * mirror, ear, ear * mirror]
    names = [side + joint for joint in JOINTS for side in ("Left", "Right")]
    points = np.array([*face, *(body.head(name) for name in names)])
    bones = np.zeros((17, 4), np.uint8)
    bones[:, 0] = [body.names.index("Head")] * 5 + [body.names.index(name) for name in names]
    weights = np.zeros((17, 4))
    weights[:, 0] = 1.0
    return points, bones, weights


def nose_tip(body: Body) -> Array:
    """The foremost point of the face between the eyes and the mouth."""
    v, eye = body.vertices[:BODY_VERTICES], body.eye()
    near = (np.abs(v[:, 0]) < 0.015) & (v[:, 2] < eye[2] - 0.015) & (v[:, 2] > eye[2] - 0.060)
    tip = v[near][v[near, 1].argmin()]
    return np.asarray(tip * [0.0, 1.0, 1.0])
