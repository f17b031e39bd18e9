"""The results as a page: a section for each SLAM back end, in a folder, and the page that holds them all."""

from pathlib import Path

from dotmask.atomic_file import write_atomically
from scenarios.errors import ScenarioError
from scenarios.finished_runs import figure_settings
from scenarios.run_folder import versions
from scenarios.tables.layout import ate_table, loop_table, map_table, odometry_table, paper_time_table, time_table
from scenarios.tables.measure import Reports
from scenarios.tables.plan import TablePlan

DOCS = Path(__file__).parents[2] / "docs"
"""Of a checkout; an installed package has none."""

PAGE, SECTIONS = "results.md", "results"
"""The page, and the folder beside it with its sections."""

QUICK_NOTE = "**Made with `--quick`: the first frames of each sequence alone, too few to learn anything from.**"

HEAD = """\
# Results: the paper's Tables II to IV

Written by `dotmask tables --write`, a section for each SLAM back end. The paper is Vincent et al. 2020, *Dynamic Object
Tracking and Masking for Visual SLAM*; its figures are copied as they are printed. They were measured on the recorded
sequences of the TUM RGB-D benchmark, with the segmentation network YOLACT. Ours are measured on simulated sequences of
the same names, lengths and kinds of camera motion, with the true masks (`oracle`): what can be compared is what masking
does, not the absolute errors.

- **unmasked**: raw depth to odometry and map, as RTAB-Map alone in the paper. **mdi**: all objects of interest removed
  from both. **dotmask**: the method.
- Each ATE stands beside the number of poses that it covers: a SLAM that loses the camera is not judged where it has no
  pose.
- Improvement: (unmasked - dotmask) / unmasked, as in the paper.
- A loop closure is false when its translation is more than 0.1 m wrong; the errors are means over all loop closures,
  false ones too.
- Where a sequence is run more than once: median (range)."""

TIME_NOTE = """\
CPU time of one thread in ms, the mean over all frames; `-`: the stage did not run. The masks are given, so `segment` is
no network's time. The paper's figures are wall time with its network on a GPU, without SLAM and odometry: what `front
end` leaves of them is for a network."""


TIME_NOTE_OF_NETWORK = """\
CPU time of one thread in ms, the mean over all frames; `segment` is the network's wall time; `-`: the stage did
not run. The paper's figures are wall time with its network on a GPU, without SLAM and odometry."""


def section_text(plan: TablePlan, reports: Reports) -> str:
    """The section of one back end.

    Args:
        plan: what was run.
        reports: what came of it.
    """
    times = "once" if plan.repeats == 1 else f"{plan.repeats} times"
    settings = figure_settings(plan.settings)
    del settings["methods"], settings["with_map"], settings["rtabmap"]
    network = settings.pop("network")
    stated = ", ".join(f"{name.replace('_', ' ')} `{value}`" for name, value in settings.items())
    if network is not None:
        stated += f"; weights `{network['weights_sha256'][:16]}` on {network['device']}"
    if plan.settings.rtabmap is not None:
        changed = ", ".join(f"`{name}={value}`" for name, value in plan.settings.rtabmap.parameters.items())
        stated += f"; RTAB-Map's parameters but for {changed}"
    machine = versions()
    parts = [
        f"Every sequence was run {times}, methods {', '.join(plan.methods)}: {stated}. "
        f"dotmask {machine['dotmask']}, Python {machine['python']}, {machine['machine']}.",
        "### Table II: absolute trajectory error",
        "After the last frame, with the loops closed. The paper's figures in cm.",
        ate_table(reports, plan.methods),
        "Odometry alone, as it was fed back to the tracker:",
        odometry_table(reports, plan.methods),
        "### Table III: loop closures",
        loop_table(reports),
        "### Table IV: time of a frame",
        TIME_NOTE if network is None else TIME_NOTE_OF_NETWORK,
        time_table(reports, plan.methods),
        paper_time_table(),
    ]
    maps = map_table(reports, plan.methods)
    if maps is not None:
        parts += ["### Maps", "What moving objects left in the map, and how much of the scene is there.", maps]
    if plan.frames is not None:
        parts.insert(0, QUICK_NOTE)
    return "\n\n".join(parts)


def write_page(folder: Path, plan: TablePlan, text: str) -> Path:
    """Write the section of a back end into `folder/results/` and the page `folder/results.md` with all that are there.

    Args:
        folder: of the page.
        plan: what was run.
        text: see `section_text`.

    Returns:
        The page.

    Raises:
        ScenarioError: it cannot be written.
    """
    sections = folder / SECTIONS
    try:
        sections.mkdir(parents=True, exist_ok=True)
        write_atomically(sections / f"{plan.back_end}.md", text + "\n")
        pieces = [HEAD]
        for piece in sorted(sections.glob("*.md")):
            pieces += [f"## SLAM back end `{piece.stem}`", piece.read_text(encoding="utf-8").strip()]
        write_atomically(folder / PAGE, "\n\n".join(pieces) + "\n")
    except OSError as error:
        raise ScenarioError(f"{folder / PAGE}: cannot be written ({error.strerror})") from error
    return folder / PAGE


def docs_of_checkout(plan: TablePlan) -> Path:
    """The folder `docs` of this checkout, for `--write`.

    Raises:
        ScenarioError: this is no checkout, or the plan is not worth a page.
    """
    if plan.frames is not None:
        raise ScenarioError("--write: a page from the first frames alone would mislead; leave out --quick or --write")
    if not (DOCS / "design.md").exists():
        raise ScenarioError("--write: this is an installed package; in a checkout the page docs/results.md is written")
    return DOCS
