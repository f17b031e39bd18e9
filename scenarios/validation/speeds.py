"""How soon the classification answers, by the speed of the object and of the camera; ROC of the speeds."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dotmask.evaluation.classification import roc
from dotmask.pipeline import FrameResult
from dotmask.profiles import CALIBRATED
from scenarios.camera import camera_model
from scenarios.spec import PeopleSpec, PersonSpec, Scenario, StandAct, ThingSpec, WalkAct
from scenarios.validation.plots import lines, receiver_curves
from scenarios.validation.runs import THREADS, Contender, all_profiles, play
from scenarios.validation.section import Context, Section, markdown_table, number
from scenarios.world import build_scene
from sim.geometry import FloatArray, look_at
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Motion
from sim.sensor.parameters import KINECT_V1
from sim.sensor.timing import Timing
from sim.simulator import Simulator

CHAIR_SPEEDS_M_S = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
PERSON_SPEEDS_M_S = (0.6, 1.0, 1.5)
CAMERA_SPEEDS_M_S = (0.0, 0.5, 1.0, 2.0)
CAMERA_TEST_SPEED_M_S = 0.5
"""Speed of the chair while the camera's is varied."""
STANDS_S, MOVES_S, WAY_M, RESTS_S = 1.0, 2.0, 1.9, 2.0
"""The chair stands, moves for so long but not farther than so far, and rests."""
SWAY_M = 0.4
"""The camera goes from side to side, so far from the middle."""
EYE_M, TARGET_M = (0.0, -2.9, 2.3), (0.0, 0.15, 0.4)
"""High enough to look over the low shelf: nothing hides the object."""

RATE_HZ = 30.0

CHAIR = Scenario(
    name="slid_chair",
    description="A chair slides through the office at a constant speed.",
    things=(ThingSpec(name="chair", kind="chair", look="red", position_m=(-0.9, 0.15, 0.0)),),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slid:
    """A motion along x that begins and ends at once.

    Attributes:
        resting: where the object is before.
        speed_m_s: while it moves.
        begin_s, end_s: when it moves.
    """

    resting: Motion
    speed_m_s: float
    begin_s: float
    end_s: float

    def palette_at(self, time_s: float) -> FloatArray:
        """(B, 4, 4) rest frame to world."""
        return self._shift(time_s) @ self.resting.palette_at(0.0)

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_object` (4, 4)."""
        return self._shift(time_s) @ self.resting.pose_at(0.0)

    def _shift(self, time_s: float) -> FloatArray:
        shift = np.eye(4)
        shift[0, 3] = self.speed_m_s * (min(max(time_s, self.begin_s), self.end_s) - self.begin_s)
        return shift


@dataclass(frozen=True, slots=True, kw_only=True)
class SidewaysPath:
    """A camera that goes from side to side and looks ahead.

    Attributes:
        peak_speed_m_s: in the middle.
    """

    peak_speed_m_s: float

    def pose_at(self, time_s: float) -> FloatArray:
        """`T_world_camera` (4, 4)."""
        offset = (SWAY_M * math.sin(self.peak_speed_m_s / SWAY_M * time_s), 0.0, 0.0)
        return look_at(np.add(EYE_M, offset), np.add(TARGET_M, offset))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answers:
    """What one contender said of the one object of a run, frame by frame.

    Attributes:
        true_speed_m_s: (T,) of its centre.
        speed_m_s: (T,) of its track; NaN without one.
        is_flagged: (T,) what has no track is masked, hence flagged.
    """

    true_speed_m_s: FloatArray
    speed_m_s: FloatArray
    is_flagged: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    def flag_latency_frames(self, speed_m_s: float) -> int | None:
        """From the first frame above half of the nominal speed to the first flag; None: it never came."""
        first, end = self._motion(speed_m_s)
        return _first(self.is_flagged[first:end])

    def unflag_latency_frames(self, speed_m_s: float) -> int | None:
        """From the first frame after the motion to the first without flag; None: it never came."""
        return _first(~self.is_flagged[self._motion(speed_m_s)[1] :])

    def idle_flag_share(self, speed_m_s: float) -> float:
        """Share of the frames before the motion that are flagged, without the first ten, in which nothing is known."""
        return float(np.mean(self.is_flagged[10 : self._motion(speed_m_s)[0]]))

    def _motion(self, speed_m_s: float) -> tuple[int, int]:
        moving = np.flatnonzero(self.true_speed_m_s > 0.5 * speed_m_s)
        return int(moving[0]), int(moving[-1]) + 1


def slid_chair(speed_m_s: float, camera_speed_m_s: float) -> Simulator:
    """A chair that stands, slides to the right at `speed_m_s`, and stands again."""
    end_s = STANDS_S + min(MOVES_S, WAY_M / speed_m_s)
    scene = build_scene(CHAIR)
    objects = tuple(
        replace(o, motion=Slid(resting=o.motion, speed_m_s=speed_m_s, begin_s=STANDS_S, end_s=end_s))
        if o.is_actor
        else o
        for o in scene.objects
    )
    scene = replace(scene, objects=objects)
    camera = camera_model(CHAIR.camera)
    return Simulator(
        scene=scene,
        camera=camera,
        camera_path=SidewaysPath(peak_speed_m_s=camera_speed_m_s),
        sensor=replace(KINECT_V1, timing=Timing()),
        renderer=VisibilityBufferRenderer(scene, camera, THREADS),
        seed=0,
        frames=round((end_s + RESTS_S) * RATE_HZ),
        frame_rate_hz=RATE_HZ,
    )


def walker(speed_m_s: float, camera_speed_m_s: float) -> Simulator:
    """A person who stands, walks to the right at `speed_m_s`, and stands again."""
    person = PersonSpec(
        name="anton",
        character="man",
        outfit="plaid",
        position_m=(-0.9, 0.25),
        heading_deg=0.0,
        acts=(StandAct(duration_s=STANDS_S), WalkAct(waypoints_m=((0.9, 0.25),), speed_m_s=speed_m_s)),
    )
    scenario = Scenario(
        name="walker",
        description="A person walks through the office.",
        people=PeopleSpec(cast=(person,)),
    )
    scene, camera = build_scene(scenario), camera_model(scenario.camera)
    return Simulator(
        scene=scene,
        camera=camera,
        camera_path=SidewaysPath(peak_speed_m_s=camera_speed_m_s),
        sensor=replace(KINECT_V1, timing=Timing()),
        renderer=VisibilityBufferRenderer(scene, camera, THREADS),
        seed=0,
        frames=round((STANDS_S + 1.8 / speed_m_s + RESTS_S) * RATE_HZ),
        frame_rate_hz=RATE_HZ,
    )


def answers(
    simulator: Simulator, contenders: Mapping[str, Contender], advance: Callable[[], None]
) -> dict[str, Answers]:
    """What each contender says of the only object of interest."""
    true_speeds: list[float] = []
    said: dict[str, list[tuple[float, bool]]] = {name: [] for name in contenders}
    for frame, results in play(simulator, contenders, advance):
        [actor] = frame.truth.objects
        true_speeds.append(float(np.linalg.norm(actor.velocity_world)))
        for name, result in results.items():
            said[name].append(_answer(result))
    return {
        name: Answers(
            true_speed_m_s=np.array(true_speeds),
            speed_m_s=np.array([speed for speed, _ in rows]),
            is_flagged=np.array([flag for _, flag in rows]),
        )
        for name, rows in said.items()
    }


def write(context: Context) -> str:
    """See Section."""
    contenders = all_profiles()
    thresholds = ", ".join(f"{n} {c.profile.class_model('chair').speed_threshold_m_s:g}" for n, c in contenders.items())
    speeds = CHAIR_SPEEDS_M_S[2:5:2] if context.is_quick else CHAIR_SPEEDS_M_S
    walks = PERSON_SPEEDS_M_S[1:2] if context.is_quick else PERSON_SPEEDS_M_S
    cameras = CAMERA_SPEEDS_M_S[1:4:2] if context.is_quick else CAMERA_SPEEDS_M_S
    chairs = {v: answers(slid_chair(v, 0.2), contenders, context.advance) for v in speeds}
    people = {v: answers(walker(v, 0.2), contenders, context.advance) for v in walks}
    feedbacks = {
        feedback: Contender(profile=CALIBRATED, pose_feedback=feedback)
        for feedback in ("previous", "constant_velocity", "refined")
    }
    fast = {
        v: answers(slid_chair(CAMERA_TEST_SPEED_M_S, v), {"paper": contenders["paper"], **feedbacks}, context.advance)
        for v in cameras
    }
    flags = {name: [chairs[v][name].flag_latency_frames(v) for v in speeds] for name in contenders}
    latencies = context.plot(
        "latency_speed",
        "Latency by speed of the object",
        lambda f: lines(f, speeds, flags, "speed of the chair, m/s", "frames until flagged", is_log_x=True),
    )
    shares = {
        name: [fast[v][name].idle_flag_share(CAMERA_TEST_SPEED_M_S) for v in cameras] for name in fast[cameras[0]]
    }
    idle = context.plot(
        "idle_camera_speed",
        "Idle chairs flagged by speed of the camera",
        lambda f: lines(f, cameras, shares, "peak speed of the camera, m/s", "share of frames flagged at rest"),
    )
    return "\n\n".join(
        [
            f"A chair stands for {STANDS_S:g} s, slides at a constant speed for {MOVES_S:g} s (not farther than "
            f"{WAY_M:g} m), and stands again; a person stands, walks and stands. Sensor `kinect_v1`, "
            "closed loop with odometry, the camera goes from side to side at up to 0.2 m/s. Latencies in frames "
            "at 30 Hz, from the first frame above half of the nominal speed, and from the first frame after the "
            "motion; - means that the answer never came. "
            f"The speed thresholds of a chair: {thresholds} m/s.",
            _latency_table("chair", chairs, list(contenders)),
            latencies,
            _latency_table("person", people, list(contenders)),
            f"The same chair at {CAMERA_TEST_SPEED_M_S:g} m/s, by the peak speed of the camera and by what the "
            "tracker is told of the camera's pose (profile `calibrated`; `paper` uses `previous`): frames until "
            "flagged / until unflagged / share of frames flagged while it stands.",
            _camera_table(fast),
            idle,
            _roc(context, chairs, list(contenders)),
        ]
    )


def _answer(result: FrameResult) -> tuple[float, bool]:
    """Speed of the object's track, NaN without one, and whether it is flagged."""
    seen = [t for t in result.front_end.tracks if t.detection_index is not None and t.verdict is not None]
    if not seen:
        return math.nan, True
    verdict = seen[0].verdict
    assert verdict is not None
    return verdict.speed_m_s, verdict.is_moving


def _latency_table(what: str, runs: Mapping[float, Mapping[str, Answers]], names: Sequence[str]) -> str:
    header = [f"speed of the {what}, m/s"]
    for name in names:
        header += [f"{name}: flag", "unflag", "flagged at rest"]
    rows = []
    for speed, by_name in runs.items():
        row = [f"{speed:g}"]
        for name in names:
            said = by_name[name]
            row += [
                number(said.flag_latency_frames(speed), 0),
                number(said.unflag_latency_frames(speed), 0),
                number(said.idle_flag_share(speed)),
            ]
        rows.append(row)
    return markdown_table(header, rows)


def _camera_table(runs: Mapping[float, Mapping[str, Answers]]) -> str:
    names = list(next(iter(runs.values())))
    rows = []
    for camera_speed, by_name in runs.items():
        row = [f"{camera_speed:g}"]
        for name in names:
            said = by_name[name]
            flag, unflag = (
                number(said.flag_latency_frames(CAMERA_TEST_SPEED_M_S), 0),
                number(said.unflag_latency_frames(CAMERA_TEST_SPEED_M_S), 0),
            )
            row.append(f"{flag} / {unflag} / {said.idle_flag_share(CAMERA_TEST_SPEED_M_S):.2f}")
        rows.append(row)
    return markdown_table(["camera, m/s", *names], rows)


def _roc(context: Context, runs: Mapping[float, Mapping[str, Answers]], names: Sequence[str]) -> str:
    """Over the frames of all chairs: what each threshold on the track's speed alone would give."""
    curves, points, rows = {}, {}, []
    for name in names:
        truth = np.concatenate([by_name[name].true_speed_m_s > 0.01 for by_name in runs.values()])
        speed = np.concatenate([by_name[name].speed_m_s for by_name in runs.values()])
        flags = np.concatenate([by_name[name].is_flagged for by_name in runs.values()])
        known = np.isfinite(speed)
        curve = roc(speed[known], truth[known])
        assert curve is not None
        curves[name] = curve.false_positive_rate, curve.true_positive_rate
        points[name] = float(flags[~truth].mean()), float(flags[truth].mean())
        rows.append([name, number(curve.auc, 3), number(points[name][0], 3), number(points[name][1], 3)])
    plot = context.plot("roc", "ROC of the speed threshold", lambda f: receiver_curves(f, curves, points), (5, 4))
    return "\n\n".join(
        [
            "ROC of the speed threshold, over all frames of all chairs above: the line is what a threshold on the "
            "track's speed alone would give, the dot is what the profile's whole classification gives.",
            markdown_table(["profile", "area under the curve", "false positive rate", "true positive rate"], rows),
            plot,
        ]
    )


def _first(values: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> int | None:
    found = np.flatnonzero(values)
    return int(found[0]) if len(found) else None


SECTION = Section(name="speeds", title="Latency by speed, and the speed threshold", write=write)
