"""Which stage is to blame, and what motion, masking and the method cost."""

import tempfile
from pathlib import Path

from scenarios.attribution.report import Attribution, Figures
from scenarios.attribution.run import attribute
from scenarios.attribution.variants import ALL_TRUE, BASELINE
from scenarios.counterfactual import METHODS, Triplet, run_triplet
from scenarios.registry import scenario
from scenarios.run import RunSettings
from scenarios.spec import first_frames
from scenarios.validation.section import Context, Section, markdown_table, number

SCENARIO = "fr3_walking_xyz"
PROFILES = ("paper", "calibrated")
FRAMES, QUICK_FRAMES = 200, 20


def write(context: Context) -> str:
    """See Section."""
    frames = QUICK_FRAMES if context.is_quick else FRAMES
    shortened = first_frames(scenario(SCENARIO), frames)
    parts = [
        f"`{SCENARIO}`, the first {frames} frames. Each stage of the method is replaced by the truth: alone (gain: "
        "what repairing it gains), and all but it (cost: what its errors alone cost). See docs/attribution.md."
    ]
    with tempfile.TemporaryDirectory() as parent:
        for profile in PROFILES:
            settings = RunSettings.parse(methods="dotmask", profile=profile)
            found = attribute(shortened, settings, Path(parent) / profile, context.advance)
            parts += [f"Profile `{profile}`:", _blame(found)]
        triplet = run_triplet(shortened, RunSettings.parse(), Path(parent) / "triplet", context.advance)
    parts += ["The same camera in a world where nothing moves, and in one without people; ATE in mm:", _worlds(triplet)]
    return "\n\n".join(parts)


def _blame(found: Attribution) -> str:
    rows = [
        ["the method as it is", *_cells(found.figures[BASELINE.name]), "", "", ""],
        ["every stage true", *_cells(found.figures[ALL_TRUE.name]), "", "", ""],
        *([f"`{stage}`", *_cells(blame.gain), *_cells(blame.cost)] for stage, blame in found.blame.items()),
    ]
    kinds = [f"{kind}: {what}" for kind in ("gain", "cost") for what in ("ATE, mm", "MOC error, %", "leak, %")]
    return markdown_table(["stage", *kinds], rows)


def _cells(figures: Figures) -> list[str]:
    return [number(figures.ate_rmse_m, 1, 1e3), number(figures.moc_error, 1, 100), number(figures.leak, 2, 100)]


def _worlds(triplet: Triplet) -> str:
    rows = [
        [world, *(number(errors[method], 1, 1e3) for method in METHODS)] for world, errors in triplet.ate_rmse_m.items()
    ]
    return markdown_table(["world", *METHODS], rows)


SECTION = Section(name="attribution", title="Attribution and counterfactuals", write=write)
