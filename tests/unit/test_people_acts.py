"""Every act of a person on the real meshes: when it happens, where it leads, no jumps, no sliding, hands in place."""

import math

import numpy as np
import pytest

from sim.errors import MotionError
from sim.people.body import Body, Soles
from sim.people.characters import CHARACTERS, load_character, skin
from sim.people.grip import PUSH_AHEAD_M, PUSH_BEHIND_AXIS_M, PUSH_HEIGHT_M, box_grip, cup_grip
from sim.people.kernels import rotation
from sim.people.motion import Envelope
from sim.people.script import Script
from sim.people.seat import Seat, place_before
from sim.people.walk_steps import eased

STEP_S = 0.005
FASTEST_M_S = 6.0
SLIDE_M = 0.005
CONTACT_M = 0.002
SEAT = Seat(position_world=(2.9, 0.0), heading_rad=math.pi, height_m=0.47)
BOX_M = (0.35, 0.28, 0.25)


class Person:
    def __init__(self, name):
        self.character = load_character(name)
        self.soles = Soles.of(self.character)
        self.body = Body(self.character.skeleton, self.soles)
        picked = [(s, np.arange(0, len(s.vertices), 100)) for s in self.character.surfaces]
        self._sample = tuple(
            np.vstack([getattr(s, field)[i] for s, i in picked]) for field in ("vertices", "bones", "weights")
        )

    def vertices(self, palette):
        return skin(*self._sample, palette)

    def under_feet(self, palette):
        return skin(self.soles.points[::5], self.soles.bones[::5], self.soles.weights[::5], palette)

    def joint(self, palette, name):
        bone = self.character.skeleton.index(name)
        return palette[bone, :3, :3] @ self.character.skeleton.heads[bone] + palette[bone, :3, 3]

    def hand(self, palette, name):
        """From the wrist to the first finger joint, and from the knuckles to the thumb."""
        knuckles = self.joint(palette, name.removesuffix("Hand") + "FingerBase")
        fingers = self.joint(palette, name + "Finger1") - self.joint(palette, name)
        return fingers, self.joint(palette, name[0] + "Thumb") - knuckles


@pytest.fixture(scope="module")
def people():
    return {name: Person(name) for name in CHARACTERS}


def everything(body):
    """Walk to the chair, sit, gesture, stand up, leave, push a chair, walk on."""
    script = Script(body, (0.0, 0.0), 0.3, seed=3)
    script.stand(0.5)
    script.walk([(1.5, 0.1), (2.4, 0.1)], 1.2)
    script.turn(math.pi / 2)
    script.sit_down(SEAT)
    script.sit(1.5)
    script.stand_up()
    script.walk([(2.2, -1.2)], 1.0)
    script.push("chair", (1.5, -1.2), math.pi, 1.5, 0.8)
    script.walk([(0.3, 1.2)], 1.7)
    script.stand(0.5)
    return script.motion()


@pytest.mark.parametrize(
    "name", ["man", *(pytest.param(name, marks=pytest.mark.slow) for name in CHARACTERS if name != "man")]
)
def test_a_whole_script_has_no_jumps_no_sliding_feet_and_no_stretched_legs(people, name):
    person = people[name]
    motion, body = everything(person.body), person.body
    times = np.arange(-0.1, motion.acts[-1].end_s + 0.3, STEP_S)
    before, feet, stretch = None, [], 0.0
    for t in times:
        palette = motion.palette_at(t)
        vertices = person.vertices(palette)
        if before is not None:
            assert np.linalg.norm(vertices - before, axis=1).max() < FASTEST_M_S * STEP_S, t
        before = vertices
        assert vertices[:, 2].min() > -0.003
        feet.append(person.under_feet(palette))
        posture = motion.posture_at(t)
        hips = posture.hips + body.hip_offset @ rotation(*posture.pelvis).T
        stretch = max(stretch, (np.linalg.norm(posture.ankles - hips, axis=1) / (body.thigh_m + body.shin_m)).max())
    assert stretch < 0.9995
    paths = np.array(feet)
    assert paths[..., 2].min() > -0.001
    assert (paths[..., 2].min(axis=1) < CONTACT_M).all()  # somebody always stands
    contact = paths[:, :, 2] < CONTACT_M
    for k in range(paths.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], contact[:, k], [0]]).astype(int)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            assert np.linalg.norm(np.ptp(paths[start:end, k, :2], axis=0)) < SLIDE_M, times[start]


def test_the_acts_follow_on_each_other_and_can_be_read(people):
    motion = everything(people["man"].body)
    names = ["stand", "walk", "turn", "sit_down", "sit", "stand_up", "walk", "push", "walk", "stand"]
    assert [act.name for act in motion.acts] == names
    assert motion.acts[0].start_s == 0.0
    for act, following in zip(motion.acts, motion.acts[1:], strict=False):
        assert act.end_s == following.start_s
    assert motion.acts[4].duration_s == pytest.approx(1.5)


def test_the_acts_lead_where_they_should(people):
    body = people["man"].body
    motion = everything(body)
    walked, turned, sat, stood, left = (motion.acts[k].end_s for k in (1, 2, 4, 5, 6))
    np.testing.assert_allclose(motion.pose_at(walked)[:2, 3], [2.4, 0.1], atol=1e-9)
    np.testing.assert_allclose(-motion.pose_at(turned)[:2, 1], [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(motion.pose_at(sat)[:2, 3], SEAT.position_world, atol=1e-9)
    np.testing.assert_allclose(-motion.pose_at(sat)[:2, 1], [-1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(motion.pose_at(stood)[:2, 3], place_before(body, SEAT), atol=1e-9)
    np.testing.assert_allclose(motion.pose_at(left)[:2, 3], [2.2, -1.2], atol=1e-9)
    assert [motion.sitting.at(t) for t in (walked, sat, left)] == [0.0, 1.0, 0.0]


def test_after_the_last_act_the_person_stays_and_breathes(people):
    motion = everything(people["woman"].body)
    end = motion.acts[-1].end_s
    np.testing.assert_array_equal(motion.pose_at(end), motion.pose_at(end + 100.0))
    assert np.abs(motion.palette_at(end + 3.0) - motion.palette_at(end)).max() > 1e-3


def test_the_middle_of_a_walk_has_the_asked_speed(people):
    script = Script(people["man"].body)
    script.walk([(5.0, 0.0)], 1.4)
    motion = script.motion()
    middle = motion.acts[0].duration_s / 2
    speed = (motion.pose_at(middle + 0.1)[0, 3] - motion.pose_at(middle - 0.1)[0, 3]) / 0.2
    assert speed == pytest.approx(1.4, rel=0.01)


@pytest.mark.parametrize("turn_deg", [30.0, -90.0, 179.0])
def test_a_turn_takes_the_short_way_round_on_the_spot(people, turn_deg):
    script = Script(people["woman"].body, (1.0, 1.0), 0.2)
    script.turn(0.2 + math.radians(turn_deg))
    motion = script.motion()
    at = np.array([motion.pose_at(t) for t in np.linspace(0.0, motion.acts[0].end_s, 50)])
    np.testing.assert_allclose(at[:, :2, 3], 1.0, atol=1e-12)
    heading = np.unwrap(np.arctan2(-at[:, 1, 1], -at[:, 0, 1]))
    assert np.degrees(heading[-1] - heading[0]) == pytest.approx(turn_deg, abs=1e-6)
    assert (np.sign(turn_deg) * np.diff(heading) > -1e-9).all()


def test_who_pushes_has_the_palms_at_the_back_of_the_chair(people):
    for person in people.values():
        script = Script(person.body, (-0.8, 0.1))
        script.push("blue", (0.0, 0.0), 0.0, 1.5, 0.8)
        motion = script.motion()
        (push,) = motion.pushes
        assert push.chair == "blue"
        times = np.linspace(push.start_s, push.end_s, 40)
        hands = np.array([motion.hands_at(t) for t in times])
        np.testing.assert_allclose(hands[..., 2], PUSH_HEIGHT_M)
        np.testing.assert_allclose(hands[0, :, 0], -PUSH_BEHIND_AXIS_M, atol=1e-6)
        np.testing.assert_allclose(hands[-1, :, 0] - hands[0, :, 0], 1.5, atol=1e-6)
        assert (np.diff(hands[..., 0], axis=0) > -1e-9).all()
        assert np.ptp(hands[:, 0, 1]) < 1e-6
        np.testing.assert_allclose(motion.pose_at(push.start_s)[0, 3], -PUSH_BEHIND_AXIS_M - PUSH_AHEAD_M, atol=1e-6)
        for t, palms in zip(times, hands, strict=True):
            palette = motion.palette_at(t)
            for side, palm in zip(("Left", "Right"), palms, strict=True):
                assert np.linalg.norm(person.joint(palette, side + "Hand") - palm) == pytest.approx(0.0686, abs=0.002)
                fingers, thumb = person.hand(palette, side + "Hand")
                assert fingers[0] / np.linalg.norm(fingers) > 0.8  # ahead, over the edge
                assert thumb[1] * palm[1] < 0  # towards the other hand: the palm is down
        with pytest.raises(MotionError, match="no chair is pushed"):
            motion.hands_at(push.start_s - 0.1)


@pytest.mark.parametrize("name", list(CHARACTERS))
@pytest.mark.parametrize("what", ["cup", "box"])
def test_a_carried_thing_stays_in_the_hands_upright(people, name, what):
    person = people[name]
    grip = cup_grip(person.body) if what == "cup" else box_grip(person.body, BOX_M)
    script = Script(person.body, grip=grip)
    script.walk([(3.0, 0.0)], 1.2)
    script.turn(2.0)
    motion = script.motion()
    held = ["RightHand"] if what == "cup" else ["LeftHand", "RightHand"]
    at_rest = None
    for t in np.arange(0.0, motion.acts[-1].end_s, 0.1):
        T, palette = motion.T_world_grip(t), motion.palette_at(t)
        np.testing.assert_allclose(T[:3, 2], [0.0, 0.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(T[:3, :3], motion.pose_at(t)[:3, :3], atol=1e-12)
        wrists = np.array([T[:3, :3].T @ (person.joint(palette, hand) - T[:3, 3]) for hand in held])
        at_rest = wrists if at_rest is None else at_rest
        np.testing.assert_allclose(wrists, at_rest, atol=1e-6)
        assert 0.7 < T[2, 3] < 1.2
        for hand in held:  # fingers ahead, thumb up, as seen from the frame of the hand
            R = T[:3, :3] @ grip.wrists[int(hand == "RightHand"), :3, :3]
            fingers, thumb = person.hand(palette, hand)
            assert (R.T @ fingers)[1] / np.linalg.norm(fingers) < -0.8
            assert (R.T @ thumb)[2] > 0.01
    if what == "box":
        assert wrists[0, 0] - wrists[1, 0] == pytest.approx(BOX_M[0] + 0.044, abs=1e-6)
        belly = np.array([0.0, 0.0]) - motion.grip.foot[:2]
        assert belly[1] > BOX_M[1] / 2 + 0.15


def test_a_cup_can_be_carried_to_a_seat_but_not_a_box(people):
    body = people["man"].body
    for grip, refused in ((cup_grip(body), False), (box_grip(body, BOX_M), True)):
        script = Script(body, place_before(body, SEAT), SEAT.heading_rad, grip=grip)
        if refused:
            with pytest.raises(MotionError, match="both hands"):
                script.sit_down(SEAT)
        else:
            script.sit_down(SEAT)


def test_what_cannot_follow_is_refused(people):
    body = people["man"].body

    def sitting():
        return Script(body, seat=SEAT)

    for act in (lambda s: s.stand(1.0), lambda s: s.walk([(0.0, 1.0)], 1.0), lambda s: s.turn(1.0)):
        with pytest.raises(MotionError, match="let it stand up before"):
            act(sitting())
    with pytest.raises(MotionError, match="let it sit down before"):
        Script(body).sit(1.0)
    with pytest.raises(MotionError, match="stands already"):
        Script(body).stand_up()
    with pytest.raises(MotionError, match=r"walk to \(2\.\d+, .*\) before"):
        Script(body).sit_down(SEAT)
    with pytest.raises(MotionError, match="too short"):
        Script(body).walk([(0.3, 0.0)], 1.0)
    with pytest.raises(MotionError, match="both hands"):
        Script(body, grip=cup_grip(body)).push("blue", (0.5, 0.0), 0.0, 1.0, 0.8)
    script = Script(body)
    script.stand(1.0)
    with pytest.raises(MotionError, match="no act goes before"):
        script.walk_loop([(0.0, 0.0), (3.0, 0.0)], 1.0, closed=False, start_m=0.0)


def test_nobody_carries_or_pushes_unasked(people):
    motion = everything(people["man"].body)
    with pytest.raises(MotionError, match="carries nothing"):
        motion.T_world_grip(1.0)


def test_a_script_is_a_pure_function_of_time(people):
    person = people["man"]
    motion, times = everything(person.body), [12.0, 0.0, 30.3, 5.5, 12.0]
    first = [motion.palette_at(t).tobytes() for t in times]
    again = everything(Body(person.character.skeleton, person.soles))
    assert [again.palette_at(t).tobytes() for t in reversed(times)] == first[::-1]


def test_an_envelope_and_an_eased_share_rise_smoothly():
    envelope = Envelope(times_s=(0.0, 1.0, 3.0), values=(0.0, 0.0, 2.0))
    assert [envelope.at(t) for t in (-1.0, 0.5, 2.0, 9.0)] == [0.0, 0.0, 1.0, 2.0]
    share = np.linspace(0.0, 1.0, 1001)
    done = eased(share, 0.2)
    assert (done[0], done[-1]) == (0.0, pytest.approx(1.0))
    rate = np.diff(done) / np.diff(share)
    assert rate[0] < 0.01
    assert rate.max() == pytest.approx(1.25, abs=1e-6)
