"""Who is who: identities where people hide each other."""

from scenarios.validation.section import Context, Section, number
from scenarios.validation.tables import reports_of, scenario_table

SCENARIOS = ("crossing", "crowd")


def write(context: Context) -> str:
    """See Section."""
    return "\n\n".join(
        [
            f"The first {context.runs.frames} frames of each.",
            scenario_table(
                reports_of(context, SCENARIOS),
                [
                    ("MOTA", lambda m: number(m.tracking.mota, 3)),
                    ("IDF1", lambda m: number(m.tracking.idf1, 3)),
                    ("HOTA", lambda m: number(m.tracking.hota, 3)),
                    ("switches", lambda m: number(m.tracking.switches, 0)),
                ],
            ),
        ]
    )


SECTION = Section(name="tracking", title="Tracking", write=write)
