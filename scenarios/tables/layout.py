"""The three tables as Markdown, the paper's figures beside ours."""

import math
from collections.abc import Iterable, Sequence

from scenarios.report import Report, StageTimes
from scenarios.tables.measure import Reports
from scenarios.tables.paper import TABLE_II, TABLE_III, TABLE_IV, PaperLoops
from scenarios.tables.spread import Figure, cell, spread
from scenarios.validation.section import markdown_table, number

WITHOUT, WITH = "unmasked", "dotmask"
"""What the paper compares: the SLAM alone, and behind the method."""

STAGES = ("segment", "track", "classify", "mask", "odometry", "map")
FRONT_END = ("segment", "track", "classify", "mask")


def ate_table(reports: Reports, methods: Sequence[str]) -> str:
    """Table II: ATE of the trajectory after the last frame, with the loops closed, in centimetres."""
    header = [
        "sequence", *(f"{m}, cm / poses" for m in methods), "improvement, %",
        "paper: RTAB-Map", "DOTMask", "impr., %", "BaMVO", "Sun et al.", "DynaSLAM",
    ]  # fmt: skip
    rows = []
    for name, runs in reports.items():
        paper = TABLE_II[name]
        rows.append(
            [
                f"`{name}`",
                *_ates(runs, methods, lambda m: m.ate_optimised_rmse_m, lambda m: m.optimised_frames),
                str(paper.rtabmap),
                str(paper.dotmask),
                str(paper.improvement_percent),
                *("-" if figure is None else str(figure) for figure in (paper.bamvo, paper.sun, paper.dynaslam)),
            ]
        )
    return markdown_table(header, rows)


def odometry_table(reports: Reports, methods: Sequence[str]) -> str:
    """ATE and RPE of odometry alone: the poses that were fed back to the tracker."""
    header = ["sequence", "frames", *(f"{m}, cm / poses" for m in methods), "improvement, %"]
    header += [f"RPE {m}, mm" for m in (WITHOUT, WITH)]
    rows = [
        [
            f"`{name}`",
            str(runs[0].frames),
            *_ates(runs, methods, lambda m: m.ate_rmse_m, lambda m: m.tracked_frames),
            *(cell(runs, method, lambda m: m.rpe_trans_rmse_m, 1, 1e3) for method in (WITHOUT, WITH)),
        ]
        for name, runs in reports.items()
    ]
    return markdown_table(header, rows)


def _ates(runs: Sequence[Report], methods: Sequence[str], ate_m: Figure, poses: Figure) -> list[str]:
    """Each method's ATE beside the number of poses it covers, and the improvement of the medians as in the paper."""
    cells = [f"{cell(runs, method, ate_m, 2, 1e2)} / {cell(runs, method, poses, 0)}" for method in methods]
    before, after = (spread(runs, method, ate_m) for method in (WITHOUT, WITH))
    if before is None or after is None or before.median == 0:
        return [*cells, "-"]
    return [*cells, number(100 * (before.median - after.median) / before.median)]


def loop_table(reports: Reports) -> str:
    """Table III: loop closures and their mean errors, without and with the method."""
    header = ["sequence"]
    for whose in (WITHOUT, WITH):
        header += [f"{whose}: loops", "false", "T_err, cm", "R_err, deg"]
    for whose in ("RTAB-Map", "DOTMask"):
        header += [f"paper, {whose}: loops", "T_err, cm", "R_err, deg"]
    rows = []
    for name, runs in reports.items():
        ours = [text for method in (WITHOUT, WITH) for text in _loops(runs, method)]
        rows.append([f"`{name}`", *ours, *(text for half in TABLE_III[name] for text in _paper_loops(half))])
    return markdown_table(header, rows)


def _loops(runs: Sequence[Report], method: str) -> list[str]:
    return [
        cell(runs, method, lambda m: m.loops.count, 0),
        cell(runs, method, lambda m: m.loops.false_count, 0),
        cell(runs, method, lambda m: m.loops.trans_error_m, 2, 1e2),
        cell(runs, method, lambda m: m.loops.rot_error_rad, 2, math.degrees(1)),
    ]


def _paper_loops(half: PaperLoops) -> list[str]:
    return [str(half.count), str(half.trans_error_cm), str(half.rot_error_deg)]


def time_table(reports: Reports, methods: Sequence[str]) -> str:
    """Table IV: CPU time of a frame by stage, the mean over all frames of all sequences and runs."""
    header = ["method", "frames", *STAGES, "front end", "front end and SLAM"]
    runs = [report for repeats in reports.values() for report in repeats]
    rows = []
    for method in methods:
        by_stage = {stage: _mean_ms(runs, method, stage) for stage in STAGES}
        sums = [_sum(by_stage[stage] for stage in stages) for stages in (FRONT_END, STAGES)]
        cells = [number(ms, 1) for ms in (*by_stage.values(), *sums)]
        rows.append([method, str(sum(run.frames for run in runs)), *cells])
    return markdown_table(header, rows)


def _mean_ms(runs: Sequence[Report], method: str, stage: str) -> float | None:
    times = [(run.frames, _stage(run.methods[method].time_ms, stage)) for run in runs]
    known = [(frames, ms) for frames, ms in times if ms is not None]
    return sum(frames * ms for frames, ms in known) / sum(frames for frames, _ in known) if known else None


def _stage(times: StageTimes, stage: str) -> float | None:
    value: float | None = getattr(times, stage)
    return value


def _sum(figures: Iterable[float | None]) -> float | None:
    known = [figure for figure in figures if figure is not None]
    return sum(known) if known else None


def paper_time_table() -> str:
    """Table IV as it is printed."""
    header = ["paper's Table IV", "image", "CPU", "GPU", "ms"]
    rows = [[t.approach, t.resolution, t.cpu, t.gpu, str(t.time_ms)] for t in TABLE_IV]
    return markdown_table(header, rows, texts=4)


MAP_FIGURES: tuple[tuple[str, Figure, float], ...] = (
    ("ghosts, %", lambda m: m.map.ghost_fraction, 1e2),
    ("accuracy, cm", lambda m: m.map.accuracy_m, 1e2),
    ("completeness, %", lambda m: m.map.completeness, 1e2),
)


def map_table(reports: Reports, methods: Sequence[str]) -> str | None:
    """What is left of moving objects in the map, for the paper's figure of maps; None where no run made one."""
    header = ["sequence", *(f"{m}: {heading}" for m in methods for heading, _, _ in MAP_FIGURES)]
    rows = [
        [f"`{name}`", *(cell(runs, method, figure, 1, scale) for method in methods for _, figure, scale in MAP_FIGURES)]
        for name, runs in reports.items()
    ]
    is_measured = any(text != "-" for row in rows for text in row[1:])
    return markdown_table(header, rows) if is_measured else None
