"""Render once, run every variant of the method on the same bytes, and say which stage is to blame."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np

from dotmask.pipeline import FrameResult
from dotmask.profiles import ORIGINAL
from dotmask.profiles import profile as get_profile
from dotmask.records import FloatArray, RgbdFrame
from scenarios.attribution.report import Attribution, add_up, blame_stages, figures_of
from scenarios.attribution.steps import Step, StepMeter, correlate
from scenarios.attribution.true_stages import build_front_end
from scenarios.attribution.variants import ALL_TRUE, BASELINE, VARIANTS, Variant
from scenarios.attribution.witness import Sighting, Witness, look
from scenarios.errors import ScenarioError
from scenarios.judge import Judge
from scenarios.oracle import OracleSegmenter
from scenarios.plots import Scatter, draw_scatters
from scenarios.report import MethodReport
from scenarios.run import RunSettings, closed_loop, one_opencv_thread
from scenarios.run_folder import RunFolder, versions
from scenarios.segmenters import load_segmenter, segmenter_report, segmenter_threads
from scenarios.sources import Simulated
from scenarios.spec import Scenario
from sim.records import GroundTruth

STEP_COLUMNS = ("variant", *(field.name for field in fields(Step)))

END_TITLES = "the method as it is", "every stage true"


class VariantRun:
    """One variant in closed loop with SLAM, and what is measured of it."""

    def __init__(
        self, variant: Variant, settings: RunSettings, first: RgbdFrame, T_world_camera: FloatArray, folder: Path
    ) -> None:
        self.variant = variant
        self._witness = Witness()
        front_end = build_front_end(variant.true_stages, self._witness, get_profile(settings.profile))
        self._loop = closed_loop(front_end, settings, first, T_world_camera, folder / variant.name)
        self._judge = Judge(variant.name)
        self._meter = StepMeter()
        self.steps: list[Step] = []

    def step(self, frame: RgbdFrame, truth: GroundTruth, sighting: Sighting) -> FrameResult:
        """Process the next frame."""
        self._witness.show(truth, sighting)
        return self._loop.step(frame)

    def report(self) -> MethodReport:
        """All figures, after the last frame."""
        return self._judge.report(self._loop.finish())

    def see(self, truth: GroundTruth, result: FrameResult, folder: RunFolder) -> None:
        """Measure what came of it and append the rows of the tables."""
        self._judge.see(truth, result, folder)
        self.steps.append(self._meter.see(truth, result))
        folder.append("steps.csv", STEP_COLUMNS, (self.variant.name, *astuple(self.steps[-1])))


def attribute(scenario: Scenario, settings: RunSettings, out: Path, advance: Callable[[], None]) -> Attribution:
    """Run all variants of a scenario and write the folder `out`.

    Args:
        scenario: what happens.
        settings: how it is run; of the methods only `dotmask` is.
        out: a new or empty folder.
        advance: called after every frame of every variant.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input; nothing is left in `out`.
    """
    profile = get_profile(settings.profile)
    if profile is ORIGINAL:
        raise ScenarioError("attribute: the profile original is another program without these stages; choose another")
    source = Simulated(scenario, settings.renderer, settings.threads)
    segmenter = load_segmenter(settings.segmenter, settings.network, source)
    exact = OracleSegmenter()
    with (
        RunFolder(out) as folder,
        one_opencv_thread(),
        segmenter_threads(settings.network, settings.threads),
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        source.describe(folder)
        runs: tuple[VariantRun, ...] = ()
        digest = hashlib.sha256()
        for timed in source.frames():
            frame, truth = timed.frame.frame, timed.frame.truth
            assert isinstance(truth, GroundTruth), "a simulated source knows all"
            digest.update(frame.rgb.tobytes())
            digest.update(frame.depth_m.tobytes())
            segmenter.see(frame, truth)
            exact.show(frame.index, truth)
            if not runs:
                runs = tuple(VariantRun(v, settings, frame, truth.T_world_camera, folder.path) for v in VARIANTS)
            found, true = (look(chosen, frame, truth, profile) for chosen in (segmenter, exact))
            sightings = [true if "masks" in run.variant.true_stages else found for run in runs]
            # Each variant has its own state, so the order in which they are done cannot matter.
            results = pool.map(
                lambda run, sighting, frame=frame, truth=truth: run.step(frame, truth, sighting), runs, sightings
            )
            for run, result in zip(runs, results, strict=True):
                run.see(truth, result, folder)
                advance()
        by_name = {run.variant.name: run for run in runs}
        reports = {name: run.report() for name, run in by_name.items()}
        figures = {name: figures_of(report) for name, report in reports.items()}
        blame = blame_stages(figures)
        ends = (BASELINE.name, ALL_TRUE.name)
        attribution = Attribution(
            scenario=scenario.name,
            seed=scenario.seed,
            frames=len(source),
            renderer=settings.renderer,
            segmenter=segmenter_report(settings.segmenter, settings.network),
            slam=settings.slam,
            profile=settings.profile,
            pose_feedback=settings.pose_feedback,
            frame_hash=digest.hexdigest(),
            figures=figures,
            blame=blame,
            sum=add_up(blame),
            total=figures[BASELINE.name] - figures[ALL_TRUE.name],
            correlation={name: correlate(by_name[name].steps) for name in ends},
            variants=reports,
        )
        draw_scatters(
            folder.path / "error_against_leak.png",
            f"{scenario.name}, seed {scenario.seed}, {len(source)} frames, profile {settings.profile}",
            "leaked pixels in the frame",
            "error of the motion from the frame before, mm",
            [_panel(title, by_name[name].steps) for name, title in zip(ends, END_TITLES, strict=True)],
        )
        folder.write("versions.json", json.dumps(versions(), indent=2) + "\n")
        folder.write("attribution.json", attribution.to_json())
    return attribution


def _panel(title: str, steps: Sequence[Step]) -> Scatter:
    known = [(step.leaked_pixels, 1e3 * step.trans_error_m) for step in steps if step.trans_error_m is not None]
    leaked, error_mm = np.array(known, np.float64).reshape(-1, 2).T
    correlation = correlate(steps)
    note = f"{correlation.steps_with_leak} of {correlation.steps} steps with a leak"
    if correlation.pearson is not None:
        note += f"; correlation {correlation.pearson:+.2f}, of ranks {correlation.spearman:+.2f}"
    return Scatter(title=title, note=note, x=leaked, y=error_mm)
