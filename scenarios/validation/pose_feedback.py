"""What the tracker is told of the camera's pose, at a usual and at a high speed of the camera."""

from dotmask.profiles import CALIBRATED
from scenarios.registry import scenario
from scenarios.spec import first_frames, with_overrides
from scenarios.validation.runs import Contender, judged
from scenarios.validation.section import Context, Section, markdown_table, number

SCENARIO, SPEEDS = "fr3_walking_xyz", (1, 3)


def write(context: Context) -> str:
    """See Section."""
    contenders = {
        feedback: Contender(profile=CALIBRATED, pose_feedback=feedback)
        for feedback in ("previous", "constant_velocity", "refined")
    }
    rows = []
    for speed in SPEEDS[1:] if context.is_quick else SPEEDS:
        varied = with_overrides(first_frames(scenario(SCENARIO), context.runs.frames), {"camera.speed": str(speed)})
        for feedback, m in judged(varied, contenders, context.advance).items():
            rows.append(
                [
                    f"{speed}",
                    feedback,
                    number(m.ate_rmse_m, 1, 1e3),
                    number(m.ekf.position_rmse_ideal_m, 0, 1e3),
                    number(m.ekf.velocity_rmse_m_s),
                    number(m.moc.precision, 3),
                    number(m.moc.recall, 3),
                    number(m.moc.idle_flag_rate, 3),
                    number(m.masks.waste, 1, 100),
                    number(m.tracking.switches, 0),
                ]
            )
    header = [
        "camera.speed", "feedback", "ATE, mm", "position against ideal, mm", "velocity, m/s", "precision", "recall",
        "idle flag rate", "waste, %", "switches",
    ]  # fmt: skip
    return "\n\n".join(
        [
            f"`{SCENARIO}`, the first {context.runs.frames} frames, profile `calibrated`. `previous` is the "
            "paper's loop: the tracker works with the pose of the frame before, so that all that stands seems to "
            "move by what the camera moved.",
            markdown_table(header, rows, texts=2),
        ]
    )


SECTION = Section(name="pose_feedback", title="Pose feedback", write=write)
