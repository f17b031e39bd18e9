"""What is cut out of the images that odometry is given."""

from scenarios.validation.section import Context, Section, number
from scenarios.validation.tables import reports_of, scenario_table

SCENARIOS = ("fr3_walking_static", "fr3_walking_xyz", "fr3_walking_halfsphere", "crossing", "crowd")


def write(context: Context) -> str:
    """See Section."""
    return "\n\n".join(
        [
            f"The first {context.runs.frames} frames of each. IoU and boundary F-score judge the segmenter's "
            "masks: the oracle's are the true ones. Leak: share of the moving objects' pixels that odometry still "
            "sees. Waste: share of the static pixels that it lost.",
            scenario_table(
                reports_of(context, SCENARIOS),
                [
                    ("IoU", lambda m: number(m.masks.iou, 3)),
                    ("boundary F", lambda m: number(m.masks.boundary_f, 3)),
                    ("leak, %", lambda m: number(m.masks.leak, 2, 100)),
                    ("waste, %", lambda m: number(m.masks.waste, 1, 100)),
                    ("ATE, mm", lambda m: number(m.ate_rmse_m, 1, 1e3)),
                ],
            ),
        ]
    )


SECTION = Section(name="masks", title="Masks", write=write)
