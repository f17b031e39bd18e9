"""The moving object classification on every fr3 scenario."""

from scenarios.registry import SCENARIOS
from scenarios.validation.plots import bars
from scenarios.validation.section import Context, Section, number
from scenarios.validation.tables import reports_of, scenario_table


def write(context: Context) -> str:
    """See Section."""
    reports = reports_of(context, [name for name in SCENARIOS if name.startswith("fr3_")])
    profiles = list(next(iter(reports.values())))
    rates = {p: [by_profile[p].moc.idle_flag_rate for by_profile in reports.values()] for p in profiles}
    plot = context.plot(
        "moc_idle",
        "Idle flag rate by scenario",
        lambda figure: bars(figure, list(reports), rates, "share of resting objects flagged"),
        (9, 4),
    )
    return "\n\n".join(
        [
            f"The first {context.runs.frames} frames of each. A start is an object that was at rest in view and "
            "sets off; latencies in frames at 30 Hz.",
            scenario_table(
                reports,
                [
                    ("precision", lambda m: number(m.moc.precision, 3)),
                    ("recall", lambda m: number(m.moc.recall, 3)),
                    ("idle flag rate", lambda m: number(m.moc.idle_flag_rate, 3)),
                    ("ROC area", lambda m: number(m.moc.auc, 3)),
                    ("starts", lambda m: number(m.moc.starts, 0)),
                    ("missed", lambda m: number(m.moc.missed_starts, 0)),
                    ("start latency", lambda m: number(m.moc.start_latency_frames, 1)),
                    ("unflag latency", lambda m: number(m.moc.unflag_latency_frames, 1)),
                ],
            ),
            plot,
        ]
    )


SECTION = Section(name="moc", title="Moving object classification", write=write)
