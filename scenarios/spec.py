"""A scenario is data only: frozen, checked, JSON both ways. scenarios/world.py builds the simulator from it."""

import json
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from scenarios.errors import ScenarioError

Metres3 = tuple[float, float, float]
Metres2 = tuple[float, float]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Spec(BaseModel):
    """Common rules: no unknown keys, no changes, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, ser_json_inf_nan="constants")


class CameraSpec(Spec):
    """The camera and its path.

    Attributes:
        width, height: pixels.
        fx, fy, cx, cy: intrinsics in pixels at that size; the defaults are the fr3 camera of the TUM benchmark.
        path: the shape of the motion.
        position_m: nominal position of the camera in the world.
        heading_deg: nominal viewing direction about z; 0 looks along +x, 90 along +y.
        tilt_deg: nominal tilt; positive looks down.
        amplitude: factor on the path's size; 1 is like the TUM sequence of that name.
        speed: factor on the path's speed; 1 is like the TUM sequence of that name.
        trajectory: a recorded trajectory file in TUM format that replaces `path`, turned about z and moved so that
            its mean position and heading are the nominal ones.
    """

    width: Annotated[int, Field(ge=32, le=4096)] = 640
    height: Annotated[int, Field(ge=24, le=4096)] = 480
    fx: Positive = 535.4
    fy: Positive = 539.2
    cx: float = 320.1
    cy: float = 247.6
    path: Literal["static", "xyz", "rpy", "halfsphere"] = "xyz"
    position_m: Metres3 = (0.0, -2.3, 1.4)
    heading_deg: float = 90.0
    tilt_deg: Annotated[float, Field(ge=-80, le=80)] = 8.0
    amplitude: NotNegative = 1.0
    speed: Positive = 1.0
    trajectory: str | None = None


class PersonSpec(Spec):
    """One person.

    Attributes:
        name: unique in the scene.
        character, outfit: see `sim.humans.CHARACTERS`.
        action: walk along the waypoints, stand at the first, or sit on a seat at the first.
        waypoints_m: floor positions.
        closed: whether a walker goes on from the last waypoint to the first; else it turns there and walks back.
        speed_m_s: walking speed.
        start_m: how far along its way a walker is at time 0.
        heading_deg: where a standing or sitting person faces; 0 is along +x.
        amplitude: size of the small motions of a standing or sitting person; 0 is a statue.
    """

    name: str
    character: str
    outfit: str
    action: Literal["walk", "stand", "sit"] = "walk"
    waypoints_m: tuple[Metres2, ...]
    closed: bool = True
    speed_m_s: Annotated[float, Field(ge=0.3, le=2.5)] = 1.1
    start_m: float = 0.0
    heading_deg: float = 0.0
    amplitude: NotNegative = 1.0

    @model_validator(mode="after")
    def _enough_waypoints(self) -> Self:
        needed = 2 if self.action == "walk" else 1
        if len(self.waypoints_m) < needed:
            raise ValueError(f"a person who is to {self.action} needs at least {needed} waypoint(s)")
        return self


class PeopleSpec(Spec):
    """All people. `speed` is a factor on everybody's walking speed."""

    speed: Positive = 1.0
    cast: tuple[PersonSpec, ...] = ()


class PushSpec(Spec):
    """An impulse on a chair: `impulse_n_s` (world) at `height_m`, `offset_m` beside the middle (turns it)."""

    time_s: NotNegative
    impulse_n_s: Metres3
    height_m: Positive = 0.45
    offset_m: float = 0.0


class ChairSpec(Spec):
    """An office chair, and what pushes it."""

    name: str
    position_m: Metres2
    heading_deg: float = 0.0
    colour: Literal["blue", "black", "red", "green"] = "blue"
    pushes: tuple[PushSpec, ...] = ()


class SensorSpec(Spec):
    """The camera's errors: those of a first-generation Kinect, or none."""

    noise: bool = True


class Scenario(Spec):
    """A named sequence: everything that decides its bytes.

    Attributes:
        name, description, tags: for people.
        seed: of the office's looks and the sensor's noise.
        frames, frame_rate_hz: length and rate.
        camera, people, chairs, sensor: see their types.
    """

    name: str
    description: str
    tags: tuple[str, ...] = ()
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    frames: Annotated[int, Field(ge=1, le=1_000_000)] = 300
    frame_rate_hz: Positive = 30.0
    camera: CameraSpec = CameraSpec()
    people: PeopleSpec = PeopleSpec()
    chairs: tuple[ChairSpec, ...] = ()
    sensor: SensorSpec = SensorSpec()

    @model_validator(mode="after")
    def _unique_names(self) -> Self:
        names = [p.name for p in self.people.cast] + [c.name for c in self.chairs]
        if len(set(names)) != len(names):
            raise ValueError("two actors have the same name")
        return self

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame."""
        return (self.frames - 1) / self.frame_rate_hz

    def to_json(self) -> str:
        """The complete scenario; `scenario_from_json` reads it back equal."""
        return self.model_dump_json(indent=2) + "\n"


def _message(error: ValidationError) -> str:
    """The first problem of a validation in one line: where, what, and what was given."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "scenario"
    given = "" if first["type"] in ("missing", "value_error") else f" (got {first['input']!r})"
    return f"{where}: {first['msg']}{given}"


def scenario_from_json(text: str, source: str) -> Scenario:
    """A scenario from its JSON.

    Raises:
        ScenarioError: `source` holds no valid scenario; the message names the field.
    """
    try:
        return Scenario.model_validate_json(text)
    except ValidationError as error:
        raise ScenarioError(f"{source}: not a scenario: {_message(error)}") from error


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
    try:
        return Scenario.model_validate_json(json.dumps(tree), strict=True)
    except ValidationError as error:
        raise ScenarioError(f"--set: {_message(error)}") from error
