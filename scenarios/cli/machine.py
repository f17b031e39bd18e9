"""The verbs that look at this machine: bench, doctor."""

from typing import Annotated

import typer

from scenarios.cli.display import console, progress_bar


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer frames: under a minute.")] = False,
) -> None:
    """Time every stage on this machine, one core, against its budget and a peer in the same run.

    Example:  dotmask bench --quick
    """
    from scenarios.bench import bench_table

    with progress_bar() as progress:
        task = progress.add_task("bench", total=None)
        drawn = bench_table(quick, lambda: progress.advance(task))
    console().print(drawn)


def doctor() -> None:
    """Check that everything this program needs is here and unharmed.

    Example:  dotmask doctor
    """
    from scenarios.doctor import examine

    findings = examine()
    for finding in findings:
        mark = "ok " if finding.is_well else ("BAD" if finding.is_needed else "-  ")
        typer.echo(f"{mark} {finding.what}: {finding.said}")
    if any(f.is_needed and not f.is_well for f in findings):
        raise typer.Exit(2)
