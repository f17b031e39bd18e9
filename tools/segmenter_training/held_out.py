"""The test: scenarios with people, outfits, chairs, rooms and seeds that the training never saw."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from dotmask.segmentation.networks import choose_network
from scenarios.camera import camera_path
from scenarios.registry import scenario
from scenarios.segmenter_evaluation.report import SegmenterEvaluation
from scenarios.segmenter_evaluation.run import evaluate_segmenter
from scenarios.spec import (
    Act,
    CameraSpec,
    PeopleSpec,
    PersonSpec,
    Scenario,
    SensorSpec,
    SitAct,
    StandAct,
    ThingSpec,
    WalkLoopAct,
)
from scenarios.world import ROOMS
from sim.people.characters import CHARACTERS
from sim.randomness import child
from tools.segmenter_training.places import Disc, Places, is_apart
from tools.segmenter_training.split import (
    FIRST_HELD_OUT_SEED,
    HELD_OUT_CHAIRS,
    HELD_OUT_CHARACTERS,
    HELD_OUT_ROOMS,
    SHARED_LOOKS,
)

SCENARIOS, FRAMES, EVERY = 60, 240, 30
"""So many scenarios of so many frames, of which each so many-th is looked at."""
SEEDS_A_ROOM = 4
PATHS = ("static", "xyz", "rpy", "halfsphere")
CATALOG = ("fr3_walking_static", "fr3_walking_xyz", "fr3_walking_rpy", "fr3_walking_halfsphere", "fr3_sitting_xyz")
"""Scenarios of the catalog that are judged as well: their people, outfits, chairs and room are held out."""
CATALOG_EVERY = 60
WALK_M = 2.2
"""Length of a way there and back: people need room to turn."""


def held_out_scenario(number: int) -> Scenario:
    """Scenario `number` of the test; people and things stand still, as if caught in the act, and the camera moves."""
    rng = child(FIRST_HELD_OUT_SEED, "segmenter test", number)
    per_room = SCENARIOS // len(HELD_OUT_ROOMS)
    room_name = HELD_OUT_ROOMS[number // per_room % len(HELD_OUT_ROOMS)]
    seed = FIRST_HELD_OUT_SEED + number % per_room * SEEDS_A_ROOM // per_room
    places = Places(ROOMS[room_name](seed))
    taken: list[Disc] = []
    things: list[ThingSpec] = []
    cast: list[PersonSpec] = []
    for index in range(int(rng.integers(1, 4))):
        person, chair = _draw_person(rng, f"person {index}", places, taken)
        cast += [person] if person is not None else []
        things += [chair] if chair is not None else []
    for index in range(int(rng.integers(1, 4))):
        things += _draw_chair(rng, f"chair {index}", places, taken)
    for kind in ("cup", "bottle"):
        for index in range(int(rng.integers(1, 3))):
            things += _draw_small(rng, f"{kind} {index}", kind, places, taken)
    drawn = Scenario(
        name=f"held_out_{number:02d}",
        description="People, outfits, chairs, a room and a seed that the training of compact did not have.",
        seed=seed,
        frames=FRAMES,
        room=room_name,
        variant="frozen",
        people=PeopleSpec(cast=tuple(cast)),
        things=tuple(things),
        sensor=SensorSpec(
            model="kinect_v1" if rng.random() < 0.5 else "realsense_d435", motion_errors=bool(rng.random() < 0.25)
        ),
    )
    return _with_camera(drawn, rng, places, taken)


def evaluate(
    weights: Path, device: str, threads: int, scenarios: Sequence[Scenario], every: int, advance: Callable[[], None]
) -> SegmenterEvaluation:
    """The figures of `compact` with these weights; see `scenarios.segmenter_evaluation`."""
    return evaluate_segmenter(
        "compact",
        choose_network("compact", weights, device),
        scenarios,
        profile="calibrated",
        every=every,
        renderer="numba",
        threads=threads,
        advance=advance,
    )


def catalog_scenarios() -> tuple[Scenario, ...]:
    """The scenarios of CATALOG."""
    return tuple(scenario(name) for name in CATALOG)


def _draw_person(
    rng: np.random.Generator, name: str, places: Places, taken: list[Disc]
) -> tuple[PersonSpec | None, ThingSpec | None]:
    character = str(rng.choice(HELD_OUT_CHARACTERS))
    outfit = str(rng.choice(CHARACTERS[character]))
    heading = float(rng.uniform(0, 360))
    act = rng.choice(["walk", "stand", "sit"], p=(0.5, 0.25, 0.25))
    disc = places.on_floor(rng, 0.45 if act == "sit" else 0.28, taken)
    if disc is None:
        return None, None
    taken.append(disc)
    chair: ThingSpec | None = None
    acts: tuple[Act, ...] = (StandAct(duration_s=3600.0),)
    if act == "sit":
        chair = _chair(rng, f"seat of {name}", (*disc[:2], heading))
        acts = (SitAct(duration_s=3600.0),)
    elif act == "walk" and (way := _free_way(rng, disc, places)) is not None:
        start = float(rng.uniform(0.0, WALK_M))
        acts = (WalkLoopAct(waypoints_m=(way,), closed=False, speed_m_s=float(rng.uniform(0.6, 1.5)), start_m=start),)
    person = PersonSpec(
        name=name,
        character=character,
        outfit=outfit,
        position_m=disc[:2],
        heading_deg=heading,
        seated_on=None if chair is None else chair.name,
        acts=acts,
    )
    return person, chair


def _free_way(rng: np.random.Generator, disc: Disc, places: Places) -> tuple[float, float] | None:
    """Where one can walk to in a straight line from a disc."""
    for angle in rng.uniform(0, 2 * math.pi, 12).tolist():
        ahead = (WALK_M * math.cos(angle), WALK_M * math.sin(angle))
        way = [(disc[0] + share * ahead[0], disc[1] + share * ahead[1]) for share in (0.2, 0.4, 0.6, 0.8, 1.0)]
        if all(places.is_free(x, y, disc[2]) for x, y in way):
            return way[-1]
    return None


def _chair(rng: np.random.Generator, name: str, at: tuple[float, float, float]) -> ThingSpec:
    look = str(rng.choice(HELD_OUT_CHAIRS))
    return ThingSpec(name=name, kind="chair", look=look, position_m=(at[0], at[1], 0.0), heading_deg=at[2])


def _draw_chair(rng: np.random.Generator, name: str, places: Places, taken: list[Disc]) -> list[ThingSpec]:
    at_desk = places.at_desk(rng) if rng.random() < 0.6 else None
    if at_desk is not None and is_apart((*at_desk[:2], 0.3), taken):
        taken.append((*at_desk[:2], 0.3))
        return [_chair(rng, name, (*at_desk[:2], math.degrees(at_desk[2])))]
    disc = places.on_floor(rng, 0.3, taken)
    if disc is None:
        return []
    taken.append(disc)
    return [_chair(rng, name, (*disc[:2], float(rng.uniform(0, 360))))]


def _draw_small(rng: np.random.Generator, name: str, kind: str, places: Places, taken: list[Disc]) -> list[ThingSpec]:
    spot = places.on_desk(rng)
    if spot is None:
        disc = places.on_floor(rng, 0.06, taken)
        if disc is None:
            return []
        spot = (*disc[:2], 0.0)
    look, heading = str(rng.choice(SHARED_LOOKS[kind])), float(rng.uniform(0, 360))
    return [
        ThingSpec.model_validate({"name": name, "kind": kind, "look": look, "position_m": spot, "heading_deg": heading})
    ]


def _with_camera(drawn: Scenario, rng: np.random.Generator, places: Places, taken: Sequence[Disc]) -> Scenario:
    """The scenario with a hand-held camera that looks at someone, and never gets into furniture."""
    spots = [person.position_m for person in drawn.people.cast] or [disc[:2] for disc in taken] or [(0.0, 0.0)]
    while True:
        x, y = spots[int(rng.integers(len(spots)))]
        target = np.array([x, y, rng.uniform(0.4, 1.4)])
        T_world_camera = places.camera(rng, target, (1.0, 4.5), taken)
        if T_world_camera is None:
            target[:2] += rng.normal(0.0, 0.5, 2)
            continue
        ahead = T_world_camera[:3, 2]
        camera = CameraSpec.model_validate(
            {
                "path": str(rng.choice(PATHS)),
                "position_m": tuple(T_world_camera[:3, 3].tolist()),
                "heading_deg": math.degrees(math.atan2(ahead[1], ahead[0])),
                "tilt_deg": math.degrees(math.asin(-float(ahead[2]))),
                "amplitude": float(rng.uniform(0.4, 1.0)),
                "exposure_ev": float(rng.uniform(-0.6, 0.6)),
            }
        )
        made = drawn.model_copy(update={"camera": camera})
        path = camera_path(made)
        if all(places.holds(path.pose_at(index / made.frame_rate_hz)[:3, 3]) for index in range(0, FRAMES, EVERY // 2)):
            return made
