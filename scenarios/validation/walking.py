"""Errors of the filter on people and chairs, with what is bias of the measurement kept apart."""

from scenarios.registry import scenario
from scenarios.spec import first_frames
from scenarios.validation.section import Context, Section, bounds, number
from scenarios.validation.tables import reports_of, scenario_table
from scenarios.validation.visible_velocity import STRIDE_S, table, visible_velocity

SCENARIOS = ("fr3_walking_static", "fr3_walking_xyz", "fr3_walking_halfsphere")


def write(context: Context) -> str:
    """See Section."""
    return "\n\n".join(
        [
            f"The first {context.runs.frames} frames, all profiles on the same frames, each in closed loop. The "
            "ideal observation is what the estimator gives on perfect images: the error against it is the "
            "filter's own. The error against the centre adds that the visible surface is not the centre. Bias: "
            "what stays of the error when it is averaged over each object's frames.",
            scenario_table(
                reports_of(context, SCENARIOS),
                [
                    ("position against ideal, mm", lambda m: number(m.ekf.position_rmse_ideal_m, 0, 1e3)),
                    ("bias", lambda m: number(m.ekf.position_bias_ideal_m, 0, 1e3)),
                    ("against centre, mm", lambda m: number(m.ekf.position_rmse_m, 0, 1e3)),
                    ("bias", lambda m: number(m.ekf.position_bias_m, 0, 1e3)),
                    ("along the ray", lambda m: number(m.ekf.position_bias_ray_m, 0, 1e3)),
                    ("velocity, m/s", lambda m: number(m.ekf.velocity_rmse_m_s)),
                    ("bias", lambda m: number(m.ekf.velocity_bias_m_s)),
                ],
            ),
            "How well the velocity can be known at all. Legs and arms swing with every step, and the front of a person "
            "who turns moves otherwise than the body's centre. Differences from the velocity of the centre, m/s RMS "
            "over the people in view, before any error of measurement: of the mean and the median velocity of visible "
            f"points, and of the centre's own velocity averaged over two steps ({STRIDE_S:g} s, half of it in the "
            "future). What follows the surface alone errs by the former; what follows the way of a person and not the "
            "steps errs by the latter, even if it knew the future:",
            table(
                {
                    name: visible_velocity(first_frames(scenario(name), context.runs.frames), "person", context.advance)
                    for name in SCENARIOS
                }
            ),
            "Consistency on the same frames. People change their shape, chairs are half hidden, and frames of one "
            "object are not independent: these figures say how far the models are from people, not whether the "
            "filter computes well.",
            scenario_table(
                reports_of(context, SCENARIOS),
                [
                    ("NEES, centre (6)", lambda m: number(m.ekf.nees, 1)),
                    ("NEES, ideal position (3)", lambda m: number(m.ekf.nees_ideal, 1)),
                    ("NIS (3)", lambda m: number(m.ekf.nis)),
                    ("its interval", lambda m: bounds(m.ekf.nis_bounds)),
                    ("whiteness", lambda m: number(m.ekf.innovation_correlation)),
                    ("bound", lambda m: number(m.ekf.innovation_correlation_bound)),
                ],
            ),
        ]
    )


SECTION = Section(name="walking", title="Errors of the filter on people and chairs", write=write)
