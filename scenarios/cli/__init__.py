"""The command line. Each verb checks its input, calls one function and prints its result.

stdout is for results, stderr for progress and errors. Exit codes: 0 done, 1 a threshold was missed, 2 usage or
environment, 3 a bug. Heavy modules are imported inside the verbs, so that `--help` is quick.
"""

import sys
import traceback

import typer

from scenarios.cli import causes, machine, runs, scenes, segmenters, studies
from scenarios.errors import ScenarioError

app = typer.Typer(
    name="dotmask",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Does masking moving objects help your visual SLAM, when does it break, and which stage is to blame?",
    epilog="Start with:  dotmask list,  dotmask run smoke,  dotmask run fr3_walking_xyz --frames 300 --out runs/a",
)

app.command("list")(scenes.list_scenarios)
app.command()(scenes.show)
app.command()(scenes.render)
app.command()(runs.run)
app.command()(causes.attribute)
app.command()(causes.counterfactual)
app.command("evaluate-segmenter")(segmenters.evaluate_segmenter)
app.command()(scenes.check)
app.command()(machine.bench)
app.command()(studies.validate)
app.command()(studies.tables)
app.command("eval")(runs.evaluate)
app.command()(studies.sweep)
app.command()(studies.plot)
app.command()(machine.doctor)


def main() -> None:
    """Entry point: turns errors into one line and an exit code."""
    from dotmask.errors import DotmaskError
    from sim.errors import SimError

    try:
        app()
    except (ScenarioError, SimError, DotmaskError) as error:
        typer.echo(f"dotmask: {error}", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        typer.echo("dotmask: interrupted; nothing was written", err=True)
        sys.exit(130)
    except Exception:
        traceback.print_exc()
        typer.echo("dotmask: this is a bug; please report the lines above", err=True)
        sys.exit(3)
