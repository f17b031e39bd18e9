"""The validation page: its sections, one after another."""

from collections.abc import Callable, Sequence
from pathlib import Path

from scenarios.errors import ScenarioError, unknown
from scenarios.validation import attribution, consistency, faults, masks, moc, pose_feedback, speeds, tracking, walking
from scenarios.validation.runs import Runs
from scenarios.validation.section import Context, Section

SECTIONS: tuple[Section, ...] = (
    consistency.SECTION,
    walking.SECTION,
    moc.SECTION,
    speeds.SECTION,
    pose_feedback.SECTION,
    tracking.SECTION,
    masks.SECTION,
    attribution.SECTION,
    faults.SECTION,
)

FRAMES, QUICK_FRAMES = 450, 40
"""At most so many frames of each scenario."""

QUICK_NOTE = "**Made with `--quick`: too few frames and seeds to learn anything from.**\n\n"


def validate(
    out: Path, *, is_quick: bool, only: Sequence[str], show: Callable[[str], None], advance: Callable[[], None]
) -> Path:
    """Measure, and write the page `out.md` with the plots in the folder `out`.

    Each section is kept in the folder as Markdown of its own as soon as it is there: after an interruption, or a change
    of one section, `only` makes the rest, and the page holds all that the folder holds.

    Args:
        out: folder for plots and sections.
        is_quick: see Context.
        only: names of sections; empty for all.
        show: called with the title of each section when it begins.
        advance: called after every frame or episode.

    Returns:
        The page.

    Raises:
        ScenarioError: no such section, or `out` cannot be written to.
    """
    known = [section.name for section in SECTIONS]
    for name in only:
        if name not in known:
            raise unknown("section", name, known)
    runs = Runs(QUICK_FRAMES if is_quick else FRAMES, advance)
    context = Context(folder=out, is_quick=is_quick, runs=runs, advance=advance)
    page = out.parent / f"{out.name}.md"
    try:
        out.mkdir(parents=True, exist_ok=True)
        for section in SECTIONS:
            if not only or section.name in only:
                show(section.title)
                text = f"{QUICK_NOTE if is_quick else ''}{section.write(context)}\n"
                (out / f"{section.name}.md").write_text(text, encoding="utf-8")
        page.write_text(_page(out), encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"--out {out}: cannot be written ({error})") from error
    return page


def _page(folder: Path) -> str:
    parts = [
        "# Validation",
        "Written by `dotmask validate`: every figure can be measured again. Segmenter: the oracle, unless a "
        "scenario says otherwise; sensor `kinect_v1`; seed 0.",
    ]
    for section in SECTIONS:
        piece = folder / f"{section.name}.md"
        if piece.exists():
            parts += [f"## {section.title}", piece.read_text(encoding="utf-8").strip()]
    return "\n\n".join(parts) + "\n"
