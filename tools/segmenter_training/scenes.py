"""Random scenes of the training: a random room, people and things of the split, and where they are in each frame.

The people and things of a scene come from a `Scenario`, where all stand at the origin. Each frame takes some of them,
at times of their own, and puts them somewhere else: a new picture for the price of rendering it.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from scenarios.cast import build_cast
from scenarios.props import build_props
from scenarios.spec import (
    Act,
    PeopleSpec,
    PersonSpec,
    Scenario,
    SitAct,
    SitDownAct,
    StandAct,
    StandUpAct,
    ThingSpec,
    TurnAct,
    WalkLoopAct,
)
from sim.geometry import FloatArray, inverse, on_grid, pose, rotation_z
from sim.people.characters import CHARACTERS, load_character
from sim.randomness import child
from sim.records import CameraModel, Moment
from sim.scene import Light, Scene, SceneObject
from tools.segmenter_training.looks import tinted_thing, varied_person, varied_thing
from tools.segmenter_training.places import Disc, Places, is_apart, rolled
from tools.segmenter_training.split import CLASSES, SHARED_LOOKS, TRAINING_CHAIRS, TRAINING_CHARACTERS
from tools.train_vocabulary.rooms import random_room

WIDTH, HEIGHT = 640, 480
"""What a camera delivers, and the judge shows."""
PEOPLE, CHAIRS, CUPS, BOTTLES = 4, 3, 3, 3
PERSON_RADIUS_M, CHAIR_RADIUS_M, SEATED_RADIUS_M = 0.28, 0.3, 0.45
HIDDEN = pose(np.eye(3), [0.0, 0.0, -1000.0])
"""Where those are who are not in a frame: far below the floor."""
LONGEST_S = {"walk": 60.0, "stand": 12.0, "turn": 9.0, "sit": 12.0, "rise": 9.0}
"""How long people do something that is worth a picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Actors that belong together: a person with what is carried or sat on, or a thing alone.

    Attributes:
        names: of the actors.
        kind: "person", "chair", "cup", "bottle" or "box".
        longest_s: how long there is something to see.
        anchor: the actor whose own place does not count, because the group is put elsewhere; None where the origin
            of the scenario is that place.
        radius_m: on the floor.
    """

    names: tuple[str, ...]
    kind: str
    longest_s: float
    anchor: str | None
    radius_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainingScene:
    """What a number of frames share.

    Attributes:
        scene: room, people and things.
        camera: WIDTH x HEIGHT.
        places: of the room.
        groups: what a frame takes some of.
        classes: class number (from 0, as the network has them) of each instance id of a class.
    """

    scene: Scene
    camera: CameraModel
    places: Places
    groups: tuple[Group, ...]
    classes: Mapping[int, int]


def draw_scenario(seed: int, number: int) -> tuple[Scenario, tuple[Group, ...]]:
    """People and things of scene `number`, all at the origin, and which of them belong together."""
    rng = child(seed, "segmenter scene", number)
    cast: list[PersonSpec] = []
    things: list[ThingSpec] = []
    groups: list[Group] = []
    for index in range(PEOPLE):
        person, used, group = _draw_person(rng, f"person {index}")
        cast.append(person)
        things += used
        groups.append(group)
    for kind, count in (("chair", CHAIRS), ("cup", CUPS), ("bottle", BOTTLES), ("box", 1)):
        for index in range(count):
            name = f"loose {kind} {index}"  # the room has names like "cup 0"
            looks = TRAINING_CHAIRS if kind == "chair" else SHARED_LOOKS[kind]
            things.append(_draw_thing(rng, name, kind, looks))
            radius = CHAIR_RADIUS_M if kind in ("chair", "box") else 0.06
            groups.append(Group(names=(name,), kind=kind, longest_s=0.0, anchor=None, radius_m=radius))
    scenario = Scenario(
        name=f"segmenter scene {number}",
        description="People and things at the origin.",
        seed=int(rng.integers(1, 1_000_000)),
        variant="frozen",  # of the things: physics does not run; the people move
        people=PeopleSpec(cast=tuple(cast)),
        things=tuple(things),
    )
    return scenario, tuple(groups)


def build_scene(seed: int, number: int) -> TrainingScene:
    """Scene `number` of a training: a pure function of the two."""
    rng = child(seed, "segmenter looks", number)
    scenario, groups = draw_scenario(seed, number)
    room = random_room(number, seed)
    cast = build_cast(scenario)
    props = build_props(scenario, cast, room.obstacles)
    furniture = [tinted_thing(thing, rng, 0.5 if thing.instance_id == 0 else 0.25) for thing in room.objects]
    dressed = [
        varied_person(person, load_character(spec.character, spec.outfit).surface_names, rng)
        for person, spec in zip(cast, scenario.people.cast, strict=True)
    ]
    varied = [varied_thing(thing, rng, 0.5) for thing in props]
    objects = (*furniture, *dressed, *varied)
    lights = tuple(
        Light(position_world=light.position_world, power=light.power * float(rng.uniform(0.5, 2.0)))
        for light in room.lights
    )
    return TrainingScene(
        scene=Scene(objects=objects, lights=lights, ambient=float(rng.uniform(0.22, 0.55))),
        camera=_draw_camera(rng),
        places=Places(room),
        groups=groups,
        classes={
            thing.instance_id: CLASSES.index(thing.class_name)
            for thing in objects
            if thing.class_name in CLASSES and thing.instance_id > 0
        },
    )


def draw_moment(drawn: TrainingScene, rng: np.random.Generator) -> tuple[Moment, str | None]:
    """A frame of a scene: who and what is there, where, and the camera; and the actor that it looks at, if any."""
    taken: list[Disc] = []
    people: list[Disc] = []
    where: dict[str, FloatArray] = {}
    times: dict[str, float] = {}
    for group in _chosen(drawn.groups, rng):
        T_world_group = _put(group, drawn.places, rng, taken, people)
        if T_world_group is None:
            continue
        time_s = float(rng.uniform(0.0, group.longest_s)) if group.longest_s else 0.0
        if group.anchor is not None:
            T_world_group = (
                T_world_group @ _stretched(rng) @ inverse(_actor(drawn, group.anchor).motion.pose_at(time_s))
            )
        for name in group.names:
            where[name], times[name] = T_world_group, time_s
    palettes = {
        actor.name: on_grid(where.get(actor.name, HIDDEN) @ actor.motion.palette_at(times.get(actor.name, 0.0)))
        for actor in drawn.scene.actors
    }
    T_world_camera, target = _look(drawn, rng, where, palettes, people)
    return Moment(T_world_camera=on_grid(T_world_camera), palettes=palettes), target


def _draw_person(rng: np.random.Generator, name: str) -> tuple[PersonSpec, list[ThingSpec], Group]:
    character = _one(rng, TRAINING_CHARACTERS)
    outfit = _one(rng, CHARACTERS[character])
    act = _one(rng, ("walk", "walk", "walk", "stand", "turn", "sit", "sit", "rise"))
    used: list[ThingSpec] = []
    chair = carried = None
    if act in ("sit", "rise"):
        chair = f"seat of {name}"
        used.append(_draw_thing(rng, chair, "chair", TRAINING_CHAIRS))
    elif rng.random() < 0.25:
        carried = f"load of {name}"
        kind = "cup" if rng.random() < 0.7 else "box"
        used.append(_draw_thing(rng, carried, kind, SHARED_LOOKS[kind]))
    person = PersonSpec(
        name=name, character=character, outfit=outfit, seated_on=chair, carries=carried, acts=_acts(rng, act, chair)
    )
    return (
        person,
        used,
        Group(
            names=(name, *(thing.name for thing in used)),
            kind="person",
            longest_s=LONGEST_S[act],
            anchor=name if chair is None else None,
            radius_m=PERSON_RADIUS_M if chair is None else SEATED_RADIUS_M,
        ),
    )


def _acts(rng: np.random.Generator, act: str, chair: str | None) -> tuple[Act, ...]:
    amplitude = float(rng.uniform(0.0, 1.5))
    stand = StandAct(duration_s=3600.0, amplitude=amplitude)
    if act == "walk":
        speed = float(rng.uniform(0.5, 1.6))
        return (WalkLoopAct(waypoints_m=((1.6, 0.0), (1.6, 1.4), (0.0, 1.4)), speed_m_s=speed),)
    if act == "turn":
        turns = (TurnAct(heading_deg=float(angle)) for angle in rng.uniform(60, 180, 2) * (1, -1))
        return (StandAct(duration_s=0.5), *turns, stand)
    if act == "stand":
        return (stand,)
    assert chair is not None
    if act == "sit":
        return (SitAct(duration_s=3600.0, amplitude=amplitude),)
    sit = SitAct(duration_s=1.0, amplitude=amplitude)
    return (sit, StandUpAct(), StandAct(duration_s=1.0), SitDownAct(chair=chair), SitAct(duration_s=3600.0))


def _draw_thing(rng: np.random.Generator, name: str, kind: str, looks: tuple[str, ...]) -> ThingSpec:
    size = tuple(rng.uniform(0.25, 0.55, 3).tolist()) if kind == "box" and not name.startswith("load") else None
    return ThingSpec.model_validate(
        {"name": name, "kind": kind, "look": _one(rng, looks), "position_m": (0.0, 0.0, 0.0), "size_m": size}
    )


def _draw_camera(rng: np.random.Generator) -> CameraModel:
    """About the camera of fr3, wider or narrower."""
    focal = 535.0 * math.exp(rng.uniform(math.log(0.85), math.log(1.25)))
    u, v = rng.uniform(-12.0, 12.0, 2).tolist()
    return CameraModel(
        width=WIDTH,
        height=HEIGHT,
        fx=focal,
        fy=focal * float(rng.uniform(0.98, 1.02)),
        cx=(WIDTH - 1) / 2 + u,
        cy=(HEIGHT - 1) / 2 + v,
        exposure_ev=float(rng.uniform(-0.6, 0.6)),
    )


def _chosen(groups: tuple[Group, ...], rng: np.random.Generator) -> Iterator[Group]:
    """Some of each kind: of four people rather two, of the things of a kind any number."""
    for kind in ("person", "chair", "box", "cup", "bottle"):
        of_kind = [group for group in groups if group.kind == kind]
        if kind == "person":
            count = int(rng.choice(PEOPLE + 1, p=(0.07, 0.25, 0.36, 0.22, 0.1)))
        else:
            count = int(rng.integers(0, len(of_kind) + 1))
        for index in rng.permutation(len(of_kind))[:count].tolist():
            yield of_kind[index]


def _put(
    group: Group, places: Places, rng: np.random.Generator, taken: list[Disc], people: list[Disc]
) -> FloatArray | None:
    """`T_world_group` (4, 4) of a free place, which is taken then; None where there is none."""
    turn = rotation_z(float(rng.uniform(0, 2 * math.pi)))
    if group.kind in ("cup", "bottle"):
        spot = places.on_desk(rng) if rng.random() < 0.75 else None
        if spot is not None:
            return pose(turn, spot)
        disc = places.on_floor(rng, group.radius_m, taken)
        if disc is None:
            return None
        if group.kind == "bottle" and rng.random() < 0.4:
            lying = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
            return pose(turn @ lying, [*disc[:2], 0.036])
        return pose(turn, [*disc[:2], 0.0])
    if (group.kind == "chair" or group.radius_m == SEATED_RADIUS_M) and rng.random() < 0.5:
        at_desk = places.at_desk(rng)
        if at_desk is not None and is_apart((*at_desk[:2], group.radius_m), taken):
            # At the origin a chair is headed along +x.
            _take((*at_desk[:2], group.radius_m), group, taken, people)
            return pose(rotation_z(at_desk[2]), [*at_desk[:2], 0.0])
    disc = places.on_floor(rng, group.radius_m, taken)
    if disc is None:
        return None
    _take(disc, group, taken, people)
    return pose(turn, [*disc[:2], 0.0])


def _take(disc: Disc, group: Group, taken: list[Disc], people: list[Disc]) -> None:
    taken.append(disc)
    if group.kind == "person":
        people.append(disc)


def _stretched(rng: np.random.Generator) -> FloatArray:
    """Taller or shorter, wider or slimmer (4, 4), about the place on the floor."""
    across, up = rng.uniform(0.92, 1.1), rng.uniform(0.93, 1.07)
    return np.diag([across, across, up, 1.0])


def _look(
    drawn: TrainingScene,
    rng: np.random.Generator,
    where: Mapping[str, FloatArray],
    palettes: Mapping[str, FloatArray],
    people: list[Disc],
) -> tuple[FloatArray, str | None]:
    """`T_world_camera`, and the name of the actor that it looks at."""
    shown = [group for group in drawn.groups if group.names[0] in where]
    kind = rng.choice(["person", "chair", "cup", "bottle"], p=(0.68, 0.18, 0.07, 0.07))
    candidates = [group for group in shown if group.kind == kind] or shown
    target, point, distances = None, None, (1.0, 4.0)
    if candidates:
        group = candidates[int(rng.integers(len(candidates)))]
        target = group.names[0]
        point = palettes[target][0][:3, 3].copy()
        if group.kind in ("person", "chair", "box"):
            point[2] = rng.uniform(0.2, 1.6) if group.kind == "person" else rng.uniform(0.1, 0.9)
            distances = (0.7, 5.5)
        else:
            distances = (0.4, 2.2)
    if point is None:
        disc = drawn.places.on_floor(rng, 0.1, [])
        point = np.array([*(disc or (0.0, 0.0, 0.0))[:2], rng.uniform(0.2, 1.4)])
    T_world_camera = drawn.places.camera(rng, point, distances, people)
    while T_world_camera is None:  # a target in a corner behind furniture: look at something else
        disc = drawn.places.on_floor(rng, 0.1, [])
        target, point = None, np.array([*(disc or (0.0, 0.0, 0.0))[:2], rng.uniform(0.2, 1.4)])
        T_world_camera = drawn.places.camera(rng, point, (0.3, 5.0), [])
    return rolled(T_world_camera, _draw_roll(rng)), target


def _draw_roll(rng: np.random.Generator) -> float:
    """Mostly nearly upright, often as on fr3_walking_rpy, seldom any angle."""
    choice = rng.random()
    if choice < 0.65:
        return float(rng.normal(0.0, math.radians(6.0)))
    most = math.radians(35.0) if choice < 0.93 else math.pi
    return float(rng.uniform(-most, most))


def _actor(drawn: TrainingScene, name: str) -> SceneObject:
    return next(actor for actor in drawn.scene.actors if actor.name == name)


def _one(rng: np.random.Generator, choices: tuple[str, ...]) -> str:
    return choices[int(rng.integers(len(choices)))]
