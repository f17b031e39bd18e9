"""Check the truth of scenarios, and print what was found."""

import json
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from scenarios.check import actors, pixels
from scenarios.check.measure import Check, Finding, Measured, joined
from scenarios.check.sample import sample_indices, take_sample
from scenarios.spec import Scenario, SensorSpec
from scenarios.world import ROOMS, build_simulator

if TYPE_CHECKING:
    from rich.table import Table

CLEARANCE_STEP_S = 0.1
"""At 2 m/s people walk 20 cm meanwhile, less than the half of their width."""

CHECKS: tuple[Check, ...] = (
    Check(
        name="optical flow",
        what="depth, scene flow and the next pose give the optical flow",
        unit="px",
        bound=0.1,
        least_share=1.0,
        measure=pixels.optical_flow_error,
    ),
    Check(
        name="next depth",
        what="depth, scene flow and the next pose give the next depth",
        unit="m",
        bound=0.001,
        least_share=0.4,
        measure=pixels.next_depth_error,
    ),
    Check(
        name="next surface",
        what="share of points that leave the surface of the next frame",
        unit="",
        bound=0.02,
        least_share=0.6,
        measure=pixels.next_surface_error,
    ),
    Check(
        name="hidden",
        what="share of an object's points that it hides itself in the next frame",
        unit="",
        bound=0.2,
        least_share=0.0,
        measure=pixels.hidden_by_itself,
    ),
    Check(
        name="next id",
        what="share of the points that stay visible, but with another id",
        unit="",
        bound=0.0005,
        least_share=0.4,
        measure=pixels.next_id_error,
    ),
    Check(
        name="place",
        what="depth and pose put a pixel inside the box of the object whose id it has",
        unit="m",
        bound=0.001,
        least_share=1.0,
        measure=pixels.place_error,
    ),
    Check(
        name="normals",
        what="share of the normals that are not the slope of the depth",
        unit="",
        bound=0.005,
        least_share=0.4,
        measure=pixels.normal_error,
    ),
    Check(
        name="static flow",
        what="what cannot move has no scene flow",
        unit="m",
        bound=1e-6,
        least_share=1.0,
        measure=actors.static_flow_error,
    ),
    Check(
        name="rigid flow",
        what="the scene flow of a thing of rigid parts is its change of pose",
        unit="m",
        bound=0.001,
        least_share=1.0,
        measure=actors.rigid_flow_error,
    ),
    Check(
        name="velocity",
        what="the velocity of a centre is its difference over time",
        unit="m/s",
        bound=0.02,
        least_share=1.0,
        measure=actors.velocity_error,
    ),
    Check(
        name="keypoint pixels",
        what="the pixel of a keypoint is the projection of its point",
        unit="px",
        bound=0.1,
        least_share=1.0,
        measure=actors.keypoint_pixel_error,
    ),
    Check(
        name="keypoints seen",
        what="share of keypoints whose visibility the images contradict",
        unit="",
        bound=0.0,
        least_share=1.0,
        measure=actors.keypoint_visibility_error,
    ),
    Check(
        name="floor",
        what="nothing sinks into the floor",
        unit="m",
        bound=0.005,
        least_share=1.0,
        measure=actors.sinking,
    ),
    Check(
        name="collisions",
        what="nobody walks through furniture or somebody else, at any time",
        unit="pairs",
        bound=0.0,
        least_share=1.0,
        measure=actors.collisions,
    ),
)


def check_scenario(
    scenario: Scenario, frames: int, renderer: str, threads: int, advance: Callable[[], None]
) -> list[Finding]:
    """Check the truth of a scenario on a few frames spread over it.

    The truth does not depend on what the sensor errs, so that an ideal sensor stands in for it.

    Args:
        scenario: what happens.
        frames: how many frames to look at, each with the next one.
        renderer: name of the renderer.
        threads: of the renderer.
        advance: called after every frame.

    Raises:
        ScenarioError, SimError: bad input, or the scenario is too short.
    """
    indices = sample_indices(scenario.frames, frames)
    ideal = scenario.model_copy(update={"sensor": SensorSpec(model="ideal")})
    simulator = build_simulator(ideal, renderer, threads)
    found: dict[str, dict[int, Measured]] = {check.name: {} for check in CHECKS}
    obstacles = ROOMS[scenario.room](scenario.seed).obstacles
    times_s = np.arange(0.0, scenario.duration_s, CLEARANCE_STEP_S)
    for index, part_s in zip(indices, np.array_split(times_s, len(indices)), strict=True):
        sample = take_sample(simulator, index, obstacles, part_s)
        for check in CHECKS:
            found[check.name][index] = check.measure(sample)
        advance()
    return [joined(scenario.name, check, found[check.name]) for check in CHECKS]


def table(findings: Iterable[Finding]) -> "Table":
    """What was found, a row a check."""
    from rich.table import Table

    drawn = Table(box=None, pad_edge=False)
    for heading in ("scenario", "check", "worst", "bound", "frame", "tested", ""):
        right = heading in ("worst", "frame", "tested")
        drawn.add_column(heading, justify="right" if right else "left", no_wrap=True)
    before = None
    for finding in findings:
        check, worst = finding.check, finding.measured.worst
        drawn.add_row(
            finding.scenario if finding.scenario != before else "",
            check.name,
            "-" if worst is None else f"{worst:.2g}",
            f"{check.bound:g} {check.unit}".rstrip(),
            "-" if finding.index is None else str(finding.index),
            "-" if finding.share is None else f"{100 * finding.share:.1f} %",
            "[green]ok[/]" if finding.passes else "[bold red]FAILED[/]",
        )
        before = finding.scenario
    return drawn


def findings_json(findings: Iterable[Finding]) -> str:
    """What was found, for programs."""
    listed = [
        {
            "scenario": finding.scenario,
            "check": finding.check.name,
            "what": finding.check.what,
            "worst": finding.measured.worst,
            "bound": finding.check.bound,
            "unit": finding.check.unit,
            "frame": finding.index,
            "tested": finding.measured.tested,
            "total": finding.measured.total,
            "least_share": finding.check.least_share,
            "passes": finding.passes,
        }
        for finding in findings
    ]
    return json.dumps(listed, indent=2) + "\n"
