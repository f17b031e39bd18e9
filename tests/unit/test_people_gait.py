"""Gait curves, forward kinematics and the feet, on a small synthetic person."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sim.errors import MotionError
from sim.people import gait
from sim.people.body import Body, Posture, Soles
from sim.people.kernels import rotation, toe_pitch
from sim.people.reference_gait import joint_angles
from sim.people.skeleton import Skeleton

LEFT = {
    "LeftUpLeg": ("Hips", (0.10, 0.0, 0.95)),
    "LeftLeg": ("LeftUpLeg", (0.12, -0.02, 0.51)),
    "LeftFoot": ("LeftLeg", (0.14, 0.0, 0.08)),
    "LeftToeBase": ("LeftFoot", (0.155, -0.15, 0.03)),
    "LeftArm": ("Spine", (0.18, 0.0, 1.45)),
    "LeftForeArm": ("LeftArm", (0.36, 0.0, 1.25)),
    "LeftHand": ("LeftForeArm", (0.50, -0.15, 1.12)),
}


def skeleton() -> Skeleton:
    bones = {"Hips": ("", (0.0, 0.0, 0.97)), "Spine": ("Hips", (0.0, 0.0, 1.2)), "Head": ("Spine", (0.0, 0.0, 1.6))}
    bones |= LEFT
    for name, (parent, (x, y, z)) in LEFT.items():
        bones[name.replace("Left", "Right")] = (parent.replace("Left", "Right"), (-x, y, z))
    names = tuple(bones)
    parents = tuple(names.index(parent) if parent else -1 for parent, _ in bones.values())
    return Skeleton(names=names, parents=parents, heads=np.array([head for _, head in bones.values()]))


def soles() -> Soles:
    """Flat soles, 11 points from the heel to the tip of the toes, the front ones carried by the toes."""
    bones = skeleton()
    points, owners = [], []
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for y in np.linspace(0.05, -0.22, 28):
            points.append([sign * (0.14 - 0.1 * y), y, 0.012 if y > 0.045 else 0.0])
            owners.append([bones.index(side + ("ToeBase" if y < -0.15 else "Foot"))])
    return Soles(points=np.array(points), bones=np.array(owners), weights=np.ones((len(points), 1)))


@pytest.fixture(scope="module")
def body() -> Body:
    return Body(skeleton(), soles())


def joint(matrices, bones, name):
    i = bones.index(name)
    return matrices[i, :3, :3] @ bones.heads[i] + matrices[i, :3, 3]


def test_palette_is_the_chain_of_relative_joint_rotations():
    bones = skeleton()
    rng = np.random.default_rng(0)
    relative = Rotation.random(len(bones.names), random_state=1).as_matrix()
    root = rng.normal(size=3)
    world, R_world = [], []
    for i, parent in enumerate(bones.parents):  # the textbook recursion with 4x4 matrices, one bone after the other
        T = np.eye(4)
        T[:3, :3] = relative[i]
        T[:3, 3] = root if parent < 0 else bones.heads[i] - bones.heads[parent]
        world.append(T if parent < 0 else world[parent] @ T)
        R_world.append(world[i][:3, :3])
    palette = bones.palette(np.array(R_world), root)
    for i in range(len(bones.names)):
        from_rest = np.eye(4)
        from_rest[:3, 3] = -bones.heads[i]
        np.testing.assert_allclose(palette[i], world[i] @ from_rest, atol=1e-12)


def test_rotation_is_yaw_after_list_after_tilt():
    expected = Rotation.from_euler("ZYX", [0.3, -0.2, 0.7]).as_matrix()
    np.testing.assert_allclose(rotation(0.3, -0.2, 0.7), expected, atol=1e-15)


def test_ankles_reach_their_places_with_the_knee_ahead(body):
    ankles = np.array([[0.10, -0.25, 0.10], [-0.08, 0.20, 0.14]])
    posture = Posture(hips=np.array([0.01, 0.0, 0.90]), ankles=ankles, foot_pitch=np.array([0.2, -0.4]))
    palette = body.palette(posture)
    for side, name in enumerate(("Left", "Right")):
        hip, knee, ankle = (joint(palette, body.skeleton, name + b) for b in ("UpLeg", "Leg", "Foot"))
        np.testing.assert_allclose(ankle, ankles[side], atol=1e-12)
        assert np.linalg.norm(knee - hip) == pytest.approx(body.thigh_m[side], abs=1e-12)
        assert np.linalg.norm(ankle - knee) == pytest.approx(body.shin_m[side], abs=1e-12)
        straight = hip + (ankle - hip) * 0.5
        assert knee[1] < straight[1] - 0.02  # the body faces -y


def test_a_foot_rolls_without_sliding_and_touches_the_floor(body):
    """Skin the left sole at two near angles: what is on the floor in both has not moved."""
    left = soles().points[:, 0] > 0
    points, owner = soles().points[left], soles().bones[left, 0]
    toe = body.skeleton.index("LeftToeBase")
    joint_at, ankle_rest = body.skeleton.heads[toe], body.ankle_rest[0]

    def posed(pitch):
        forward, up = body.rolled_ankle(0, np.array(pitch))
        ankle = np.array([*(ankle_rest[:2] + forward * body.foot_ahead[0]), up])
        R_foot, R_toe = body.foot_rotation(0, 0.0, pitch), body.foot_rotation(0, 0.0, toe_pitch(pitch))
        on_foot = (points - ankle_rest) @ R_foot.T + ankle
        on_toe = (points - joint_at) @ R_toe.T + ankle + R_foot @ (joint_at - ankle_rest)
        return np.where((owner == toe)[:, None], on_toe, on_foot)

    np.testing.assert_allclose(posed(0.0), points, atol=1e-9)
    for pitch in np.radians([-60, -45, -30, -15, -5, 5, 15, 25]):
        before, after = posed(pitch - 0.002), posed(pitch + 0.002)
        assert abs(after[:, 2].min()) < 2e-4
        lowest = int(np.argmin(before[:, 2] + after[:, 2]))
        # The arm of the foot would sweep 0.004 rad times some 0.15 m = 0.6 mm.
        assert np.linalg.norm((after - before)[lowest, :2]) < 1e-4


def test_toes_stay_on_the_floor_when_the_heel_rises():
    assert toe_pitch(np.radians(-10.0)) == pytest.approx(0.0, abs=np.radians(0.5))
    assert toe_pitch(np.radians(20.0)) == np.radians(20.0)
    assert toe_pitch(np.radians(-60.0)) < np.radians(-25.0)


@pytest.mark.parametrize(("speed", "length", "rate"), [(0.6, 0.4475, 1.341), (1.25, 0.690, 1.812), (1.8, 0.838, 2.147)])
def test_stride_grows_with_speed_as_in_koopman_table_5(speed, length, rate):
    """Worked by hand for a body of 1.75 m: ratio = -0.532 + 0.020 * 3.6 v + 0.47 * 1.75, at most that of 5 km/h."""
    found = float(gait.step_rate_hz(np.array(speed), 1.75 * gait.LEG_SHARE))
    assert found == pytest.approx(rate, abs=0.01)
    assert speed / found == pytest.approx(length, abs=0.005)


def test_the_amplitude_grows_as_the_foot_angles_of_koopman():
    percent = np.arange(0.0, 100.0)

    def extremes(speed):
        hip, knee, ankle = joint_angles(speed, 1.75, percent)
        pitch = hip - knee + ankle
        return np.array([pitch.max(), pitch.min()])

    for speed in (0.6, 0.9, 1.2, 1.38):
        ratio = extremes(speed) / extremes(gait.REFERENCE_SPEED_M_S)
        np.testing.assert_allclose(gait.amplitude(np.array(speed)), ratio, atol=0.1)


def test_swing_goes_from_0_to_1_and_clears_the_floor():
    stance = np.linspace(0.0, gait.STANCE_STEPS, 50)
    assert not gait.swing_progress(stance).any()
    assert not gait.swing_clearance_m(stance, np.ones(50)).any()
    swing = np.linspace(gait.STANCE_STEPS, 2.0, 200)[1:-1]
    progress = gait.swing_progress(swing)
    assert (np.diff(progress) > 0).all()
    assert float(gait.swing_progress(np.array(2.0 - 1e-12))) == pytest.approx(1.0)
    assert (gait.swing_clearance_m(swing, np.ones(198)) > 0).all()
    assert gait.swing_clearance_m(np.array(1.6), np.array(1.0)) > 0.02


def test_foot_pitch_is_flat_in_mid_stance_and_periodic():
    flat = gait.foot_pitch(np.linspace(0.2, 0.65, 20), np.ones(20))
    np.testing.assert_allclose(flat, 0.0, atol=1e-12)
    start, end = gait.foot_pitch(np.array([0.0, 2.0]), np.ones(2))
    assert start == pytest.approx(end)


@pytest.mark.parametrize(
    ("since", "theirs"), [(0.0, 0.0), (0.12, 6 * 66 / 62), (gait.STANCE_STEPS, 66.0), (1.6, 66 + 18 * 34 / 38)]
)
def test_the_foot_has_the_published_angle_to_the_floor(since, theirs):
    """hip - knee + ankle of Koopman et al., against what it is when the foot begins or ends to stand flat."""

    def foot(percent):
        hip, knee, ankle = joint_angles(gait.REFERENCE_SPEED_M_S, gait.REFERENCE_HEIGHT_M, np.array([percent]))
        return float((hip - knee + ankle)[0])

    start, end = (foot(percent * 66 / 62) for percent in gait.FLAT_PERCENT)
    share = max(50.0 * since - gait.FLAT_PERCENT[1], 0.0) / (100.0 - gait.FLAT_PERCENT[1])
    zero = start if 50.0 * since < gait.FLAT_PERCENT[0] else end + share * (start - end)
    found = float(np.degrees(gait.foot_pitch(np.array(since), np.array(1.0))))
    assert found == pytest.approx(foot(theirs) - zero, abs=0.2)


def test_arms_swing_opposite_to_the_legs():
    arms = gait.arm_angles(np.array([0.0, 1.0]), np.ones(2))  # right heel strike, left heel strike
    left, right = arms[:, 0, 0], arms[:, 1, 0]
    assert left[0] > right[0]
    assert right[1] > left[1]
    pelvis = gait.pelvis_angles(np.array([0.0, 1.0]), np.ones(2))[:, 0]
    chest = gait.chest_angles(np.array([0.0, 1.0]), np.ones(2))[:, 0]
    assert (pelvis * chest < 0).all()


def test_a_skeleton_without_knees_is_refused():
    bones = skeleton()
    keep = [i for i, n in enumerate(bones.names) if n not in ("LeftLeg", "LeftFoot", "LeftToeBase")]
    parents = tuple(-1 if bones.parents[i] < 0 else keep.index(bones.parents[i]) for i in keep)
    cut = Skeleton(names=tuple(bones.names[i] for i in keep), parents=parents, heads=bones.heads[keep])
    with pytest.raises(MotionError, match="LeftFoot"):
        Body(cut, soles())
