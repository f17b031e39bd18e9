"""A named sequence: everything that decides its bytes, and what the segmenter gets wrong in them."""

import json
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from scenarios.errors import ScenarioError
from scenarios.spec.base import Positive, Spec
from scenarios.spec.camera import Camera, CameraSpec
from scenarios.spec.faults import FaultsSpec
from scenarios.spec.people import PeopleSpec, PushAct, SitDownAct
from scenarios.spec.sensor import SensorSpec
from scenarios.spec.things import ThingSpec


class Scenario(Spec):
    """A named sequence: everything that decides its bytes, and what the segmenter gets wrong in them.

    Attributes:
        name, description, tags: for people.
        seed: of the room's looks, of everybody's small movements and of the sensor's noise.
        frames, frame_rate_hz: length and rate.
        room: where it plays, see `sim.rooms`.
        variant: the counterfactuals, with the same camera and seed: "moving" is the scenario itself; in "frozen" people
            and things stay as they are at time 0; in "empty" there are no people, and things stay.
        camera, people, things, sensor: see their types.
        faults: what the segmenter gets wrong; no pixel depends on it.
    """

    name: str
    description: str
    tags: tuple[str, ...] = ()
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    frames: Annotated[int, Field(ge=1, le=1_000_000)] = 300
    frame_rate_hz: Positive = 30.0
    room: Literal["office", "desk", "long_office", "corridor", "bare"] = "office"
    variant: Literal["moving", "frozen", "empty"] = "moving"
    camera: Camera = CameraSpec()
    people: PeopleSpec = PeopleSpec()
    things: tuple[ThingSpec, ...] = ()
    sensor: SensorSpec = SensorSpec()
    faults: FaultsSpec = FaultsSpec()

    @model_validator(mode="after")
    def _names(self) -> Self:
        """Names are unique, and what a person uses is there and of the right kind."""
        names = [p.name for p in self.people.cast] + [t.name for t in self.things]
        if len(set(names)) != len(names):
            raise ValueError("two actors have the same name")
        kinds = {thing.name: thing.kind for thing in self.things}
        for person in self.people.cast:
            chairs = [act.chair for act in person.acts if isinstance(act, SitDownAct | PushAct)]
            if person.seated_on is not None:
                chairs.append(person.seated_on)
            for chair in chairs:
                if kinds.get(chair) != "chair":
                    raise ValueError(f"{person.name} uses {chair!r}, but no chair has that name")
            if person.carries is not None and kinds.get(person.carries) not in ("cup", "box"):
                raise ValueError(f"{person.name} carries {person.carries!r}, but no cup or box has that name")
        return self

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame."""
        return (self.frames - 1) / self.frame_rate_hz

    def without_faults(self) -> "Scenario":
        """The same frames, and a segmenter that makes no mistakes."""
        return self.model_copy(update={"faults": FaultsSpec()})

    def has_frames_of(self, other: "Scenario") -> bool:
        """Whether all frames are the same, because everything is but the texts and the faults."""
        texts = {"name": "", "description": "", "tags": ()}
        return self.without_faults().model_copy(update=texts) == other.without_faults().model_copy(update=texts)

    def to_json(self) -> str:
        """The complete scenario; `scenario_from_json` reads it back equal."""
        return self.model_dump_json(indent=2) + "\n"


def _message(error: ValidationError, text: str) -> str:
    """The first problem of the JSON `text` in one line: where, what, and what was given."""
    first = error.errors()[0]
    parts, kind, message, given = first["loc"], first["type"], first["msg"], first["input"]
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        context = first["ctx"]
        parts = (*parts, context["discriminator"].strip("'"))
        message, given = f"Input should be one of {context.get('expected_tags')}", context.get("tag")
        if kind == "union_tag_not_found":
            kind, message = "missing", "Field required"
    where = ".".join(str(part) for part in _keys(parts, text)) or "scenario"
    return f"{where}: {message}" + ("" if kind in _GIVES_NOTHING else f" (got {given!r})")


_GIVES_NOTHING = ("missing", "value_error", "extra_forbidden", "json_invalid")


def _keys(parts: tuple[int | str, ...], text: str) -> list[int | str]:
    """`parts` without the kinds of things (`xyz` in `camera.xyz.speed`), which are no keys of the JSON `text`."""
    if len(parts) < 2:
        return list(parts)
    node, keys = json.loads(text), []
    for part in parts[:-1]:
        if isinstance(part, str) and not (isinstance(node, dict) and part in node):
            continue
        node = node[part]
        keys.append(part)
    return [*keys, parts[-1]]


def scenario_from_json(text: str, source: str) -> Scenario:
    """The scenario that a JSON text holds.

    Raises:
        ScenarioError: `source` holds no valid scenario; the message names the field.
    """
    try:
        return Scenario.model_validate_json(text)
    except ValidationError as error:
        raise ScenarioError(f"{source}: not a scenario: {_message(error, text)}") from error


def _walk(tree: Any, key: str) -> list[str]:
    """The parts of a dotted key, checked against the scenario's dump."""
    parts = key.split(".")
    node = tree
    for depth, part in enumerate(parts):
        if isinstance(node, dict):
            valid = list(node)
        elif isinstance(node, list):
            valid = [str(i) for i in range(len(node))]
        else:
            valid = []
        if part not in valid:
            at = ".".join(parts[:depth])
            where = f" under '{at}'" if at else ""
            hint = f"valid keys{where}: {', '.join(valid)}" if valid else f"'{at}' has no keys of its own"
            raise ScenarioError(f"--set {key}: unknown key '{part}'; {hint}")
        node = node[part] if isinstance(node, dict) else node[int(part)]
    return parts


def first_frames(scenario: Scenario, frames: int | None) -> Scenario:
    """`scenario` with no more than so many frames; as it is for None.

    Raises:
        ScenarioError: less than one frame.
    """
    if frames is None or frames >= scenario.frames:
        return scenario
    return with_overrides(scenario, {"frames": str(frames)})


def with_overrides(scenario: Scenario, overrides: dict[str, str]) -> Scenario:
    """A copy of `scenario` with values replaced, checked as a whole.

    Args:
        scenario: the one to vary; it is left as it is.
        overrides: dotted keys (`camera.speed`, `people.cast.0.speed_m_s`) to values as JSON, or plain text.

    Raises:
        ScenarioError: an unknown key (with the valid ones), or a value of the wrong type.
    """
    tree = json.loads(scenario.model_dump_json())
    for key, text in overrides.items():
        parts = _walk(tree, key)
        try:
            value = json.loads(text)
        except json.JSONDecodeError:
            value = text
        node = tree
        for part in parts[:-1]:
            node = node[part] if isinstance(node, dict) else node[int(part)]
        if isinstance(node, dict):
            node[parts[-1]] = value
        else:
            node[int(parts[-1])] = value
    text = json.dumps(tree)
    try:
        return Scenario.model_validate_json(text, strict=True)
    except ValidationError as error:
        raise ScenarioError(f"--set: {_message(error, text)}") from error
