"""How well what is seen of people tells the velocity of their bodies, before any error of measurement."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from dotmask.records import FloatArray
from scenarios.spec import Scenario
from scenarios.validation.section import markdown_table, number
from scenarios.world import build_simulator
from sim.truth import SurfaceMoments

EVERY = 3
"""Of so many frames one is looked at."""
LEAST_PIXELS = 200
"""Of an object that is looked at."""
STRIDE_S = 1.0
"""About two steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibleVelocity:
    """Differences from the velocity of the centre from one frame to the next: root mean square, m/s.

    Attributes:
        samples: pairs of a frame and an object in it.
        mean_m_s: of the mean velocity of the visible surface, known without any error.
        median_m_s: of its median, axis by axis.
        stride_m_s: of the centre's own velocity, averaged over `STRIDE_S` around the moment: of what follows the way of
            a person and not the steps.
    """

    samples: int
    mean_m_s: float | None
    median_m_s: float | None
    stride_m_s: float | None


def visible_velocity(scenario: Scenario, class_name: str, advance: Callable[[], None]) -> VisibleVelocity:
    """From the true displacement of each visible point of the objects of a class between two frames."""
    simulator = build_simulator(scenario, "numba", 2)
    actors = [(actor, SurfaceMoments.of(actor)) for actor in simulator.scene.actors if actor.class_name == class_name]
    differences: dict[str, list[FloatArray]] = defaultdict(list)
    for index in range(0, len(simulator) - 1, EVERY):
        images, _ = simulator.render(index, flow=True)
        assert images.flow is not None
        time_s, next_s = simulator.time_s(index), simulator.time_s(index + 1)
        around_s = (time_s - 0.5 * STRIDE_S, time_s + 0.5 * STRIDE_S)
        for actor, moments in actors:
            seen = images.flow.scene_m[images.instance_ids == actor.instance_id]
            if len(seen) < LEAST_PIXELS:
                continue
            now, then, before, after = (
                moments.centre(actor.motion.palette_at(at_s)) for at_s in (time_s, next_s, *around_s)
            )
            velocity = (then - now) / (next_s - time_s)
            differences["mean"].append(seen.mean(axis=0, dtype=np.float64) / (next_s - time_s) - velocity)
            differences["median"].append(np.median(seen, axis=0) / (next_s - time_s) - velocity)
            differences["stride"].append((after - before) / STRIDE_S - velocity)
        advance()
    rms = {name: float(np.sqrt((np.array(d) ** 2).sum(axis=1).mean())) for name, d in differences.items()}
    return VisibleVelocity(
        samples=len(differences["mean"]),
        mean_m_s=rms.get("mean"),
        median_m_s=rms.get("median"),
        stride_m_s=rms.get("stride"),
    )


def table(found: Mapping[str, VisibleVelocity]) -> str:
    """One line for each scenario."""
    header = ["scenario", "samples", "mean of the visible surface", "median", "the centre's own, over two steps"]
    rows = [
        [f"`{name}`", str(one.samples), number(one.mean_m_s), number(one.median_m_s), number(one.stride_m_s)]
        for name, one in found.items()
    ]
    return markdown_table(header, rows)
