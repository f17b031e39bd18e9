"""Show frames of scenarios to a segmenter and compare what it finds with the truth."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict

import numpy as np

from dotmask.profiles import profile as get_profile
from dotmask.segmentation.networks import NetworkChoice
from dotmask.segmentation.selection import select_detections
from scenarios.bridge import rgbd_frame_from_sim
from scenarios.errors import ScenarioError
from scenarios.run import one_opencv_thread
from scenarios.segmenter_evaluation.average_precision import AveragePrecision, Precision, TrueMask
from scenarios.segmenter_evaluation.report import ClassFigures, Milliseconds, SegmenterEvaluation
from scenarios.segmenter_evaluation.sightings import (
    Sighting,
    band,
    is_reasonable,
    misses,
    sightings_of,
    visible_actors,
)
from scenarios.segmenters import load_segmenter, segmenter_report, segmenter_threads
from scenarios.sources import Simulated
from scenarios.spec import Scenario
from scenarios.world import build_simulator
from sim.records import SimFrame
from sim.scene import Scene


def frames_of(scenario: Scenario, every: int) -> range:
    """Which frames of a scenario are looked at, if its sensor delivers all of them."""
    return range(0, scenario.frames, every)


def evaluate_segmenter(
    name: str,
    network: NetworkChoice | None,
    scenarios: Sequence[Scenario],
    *,
    profile: str,
    every: int,
    renderer: str,
    threads: int,
    advance: Callable[[], None],
) -> SegmenterEvaluation:
    """All figures of a segmenter.

    Frames are rendered one at a time, while the segmenter rests, so that its time is its own.

    Args:
        name: see `scenarios.segmenters.parse_segmenter`.
        network: what stands behind the name.
        scenarios: that are rendered.
        profile: name of the method's parameters: classes, threshold and number.
        every: every so many-th frame.
        renderer: name of the renderer.
        threads: of the renderer, and of a network on the CPU.
        advance: called after every frame.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input.
    """
    if every < 1:
        raise ScenarioError(f"--every {every}: take at least every first frame")
    chosen = get_profile(profile)
    class_names = tuple(model.name for model in chosen.classes)
    precision = AveragePrecision(class_names)
    sightings: list[Sighting] = []
    seconds: list[float] = []
    counts: dict[str, int] = {}
    with one_opencv_thread(), segmenter_threads(network, threads):
        for scenario in scenarios:
            segmenter = load_segmenter(name, network, Simulated(scenario, renderer, threads))
            simulator = build_simulator(scenario, renderer, threads)
            indices = range(0, len(simulator), every)
            counts[scenario.name] = len(indices)
            for index in indices:
                sim_frame = simulator.frame(index)
                frame = rgbd_frame_from_sim(sim_frame)
                if index == 0:
                    segmenter.see(frame, sim_frame.truth)  # to warm up
                segmenter.see(frame, sim_frame.truth)
                if segmenter.seconds is not None:
                    seconds.append(segmenter.seconds)
                found = segmenter.segment(frame)
                precision.see(frame.depth_m.shape, _true_masks(sim_frame, simulator.scene, class_names), found)
                sightings += sightings_of(sim_frame, select_detections(found, chosen), class_names, simulator)
                advance()
    return SegmenterEvaluation(
        segmenter=segmenter_report(name, network),
        profile=profile,
        scenarios=counts,
        classes={
            class_name: _figures([s for s in sightings if s.class_name == class_name], of_class)
            for class_name, of_class in precision.by_class().items()
        },
        misses=misses(sightings),
        ms=Milliseconds(
            median=1e3 * float(np.median(seconds)) if seconds else None,
            p95=1e3 * float(np.percentile(seconds, 95)) if seconds else None,
            threads=threads,
        ),
    )


def _true_masks(frame: SimFrame, scene: Scene, class_names: Sequence[str]) -> Iterator[TrueMask]:
    """All that is visible and of one of the classes.

    What counts are the actors that show enough pixels; furniture and specks do not.
    """
    ids = frame.truth.instance_ids
    counting = {actor.instance_id: actor for actor in visible_actors(frame.truth, class_names)}
    pixels = np.bincount(ids.ravel())
    for thing in scene.objects:
        number = thing.instance_id
        if thing.class_name in class_names and 0 < number < len(pixels) and pixels[number]:
            mask, actor = ids == number, counting.get(number)
            yield TrueMask(
                class_name=thing.class_name,
                mask=mask,
                counts=actor is not None,
                is_reasonable=actor is not None and is_reasonable(actor, mask),
            )


def _figures(sightings: Sequence[Sighting], precision: Precision) -> ClassFigures:
    overlaps = [s.iou for s in sightings if s.iou is not None]
    counted = band("", sightings)
    return ClassFigures(
        **asdict(precision),
        iou=float(np.mean(overlaps)) if overlaps else None,
        seen=counted.seen,
        missed=counted.missed,
        missed_share=counted.missed_share,
    )
