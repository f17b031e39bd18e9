"""Every scenario that holds a fault, so that what breaks is seen."""

from scenarios.registry import SCENARIOS
from scenarios.validation.section import Context, Section, number
from scenarios.validation.tables import reports_of, scenario_table

TAG = "faults"


def write(context: Context) -> str:
    """See Section."""
    names = [name for name, scenario in SCENARIOS.items() if TAG in scenario.tags]
    if not names:
        return f"No scenario has the tag `{TAG}`."
    return "\n\n".join(
        [
            f"All scenarios with the tag `{TAG}`, the first {context.runs.frames} frames of each.",
            scenario_table(
                reports_of(context, names),
                [
                    ("ATE, mm", lambda m: number(m.ate_rmse_m, 1, 1e3)),
                    ("precision", lambda m: number(m.moc.precision, 3)),
                    ("recall", lambda m: number(m.moc.recall, 3)),
                    ("idle flag rate", lambda m: number(m.moc.idle_flag_rate, 3)),
                    ("IDF1", lambda m: number(m.tracking.idf1, 3)),
                    ("switches", lambda m: number(m.tracking.switches, 0)),
                    ("leak, %", lambda m: number(m.masks.leak, 2, 100)),
                    ("waste, %", lambda m: number(m.masks.waste, 1, 100)),
                ],
            ),
        ]
    )


SECTION = Section(name="faults", title="Faults", write=write)
