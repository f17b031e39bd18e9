"""Options that several verbs share, and the scenario that they ask for."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenarios.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.spec import Scenario

Name = Annotated[str, typer.Argument(help="A scenario; `dotmask list` names them.", show_default=False)]
OptionalName = Annotated[str | None, typer.Argument(help="A scenario; `dotmask list` names them.", show_default=False)]
Source = Annotated[Path | None, typer.Option("--from", help="Repeat the scenario.json of another run or render.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. camera.speed=2. May be repeated."),
]
Seed = Annotated[int | None, typer.Option(help="Another seed for the office's looks and the sensor's noise.")]
Frames = Annotated[int | None, typer.Option(help="Number of frames.")]
Profile = Annotated[
    str, typer.Option(help="Parameters of the method: paper, calibrated. original: as the authors' program is.")
]
Feedback = Annotated[
    str | None, typer.Option(help="Pose for the tracker: previous, constant_velocity, refined. Default: profile's.")
]
Segmenter = Annotated[
    str,
    typer.Option(
        help="Segmenter: oracle, none, a network (yolact, yolact++, mask_rcnn, compact) or package.module:factory."
    ),
]
Weights = Annotated[Path | None, typer.Option(metavar="FILE", help="Weights of a network: .pth or .safetensors.")]
Device = Annotated[str | None, typer.Option(help="Where a network runs: cpu, cuda.", show_default="cpu")]
Renderer = Annotated[str, typer.Option(help="Renderer: numba, pyrender.")]
Slam = Annotated[str, typer.Option(help="SLAM back end: embedded, rtabmap.")]
SlamParameters = Annotated[
    str | None, typer.Option(help="Parameters of RTAB-Map: default, refined.", show_default="default")
]
SlamSet = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Change one of them, e.g. Vis/MinInliers=12. May be repeated."),
]
Threads = Annotated[int, typer.Option(min=1, max=64, help="How many threads may work. The bytes do not depend on it.")]


def _vary(scenario: "Scenario", overrides: list[str] | None, seed: int | None, frames: int | None) -> "Scenario":
    from scenarios.spec import with_overrides

    changes: dict[str, str] = {}
    for text in overrides or []:
        key, sign, value = text.partition("=")
        if not sign or not key:
            raise ScenarioError(f"--set {text}: expected KEY=VALUE, for example camera.speed=2")
        changes[key.strip()] = value.strip()
    for option, number in (("seed", seed), ("frames", frames)):
        if number is not None:
            changes[option] = str(number)
    return with_overrides(scenario, changes) if changes else scenario


def resolve(
    name: str | None, source: Path | None, overrides: list[str] | None, seed: int | None, frames: int | None
) -> "Scenario":
    """The scenario that the arguments ask for: by name or from a file, then varied."""
    from scenarios.registry import scenario
    from scenarios.spec import scenario_from_json

    if (name is None) == (source is None):
        raise ScenarioError("give the name of a scenario, or --from a scenario.json, not both")
    if source is not None:
        try:
            chosen = scenario_from_json(source.read_text(encoding="utf-8"), str(source))
        except (OSError, UnicodeDecodeError) as error:
            raise ScenarioError(f"--from {source}: cannot be read ({error})") from error
    else:
        assert name is not None
        chosen = scenario(name)
    return _vary(chosen, overrides, seed, frames)


def is_folder_name(name: str) -> bool:
    """Whether `name` means a recorded folder: it is a path, or there is no such scenario and such a folder."""
    from scenarios.registry import SCENARIOS

    return name not in SCENARIOS and (Path(name).is_dir() or "/" in name)
