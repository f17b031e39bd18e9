"""The fixture `dotmask_run`: a user's part in the standard loop, with everything else as it is in `dotmask run`."""

import importlib.metadata
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dotmask.interfaces import Segmenter, SlamBackend
from dotmask.profiles import profile as get_profile
from dotmask.records import FloatArray, Intrinsics
from pytest_dotmask.baseline import RunFigures
from pytest_dotmask.kept_frames import RENDERER, KeptFrames
from pytest_dotmask.metrics import figures
from scenarios.errors import ScenarioError, unknown
from scenarios.given_masks import ChosenMasks, MaskChoice
from scenarios.report import MethodReport
from scenarios.run import METHODS, Parts, RunSettings, run_source

MASK = "mask"
"""What a masking function is called in reports, beside `METHODS`."""


class DotmaskRun:
    """Runs a part in the standard loop, on the scenario of the test.

    Args:
        test: its name without the seed.
        frames: of the scenario.
        folder: for the run folders.
        recorded: where the figures are put for the baseline, as JSON would hold them.
        properties: of the test, for JUnit's file.
    """

    def __init__(
        self,
        test: str,
        frames: KeptFrames,
        folder: Path,
        recorded: list[dict[str, object]],
        properties: list[tuple[str, object]],
    ) -> None:
        self._test, self._frames, self._folder = test, frames, folder
        self._recorded, self._properties = recorded, properties

    def __call__(
        self,
        *,
        segmenter: Segmenter | None = None,
        mask: MaskChoice | None = None,
        slam: Callable[[Intrinsics, FloatArray], SlamBackend] | None = None,
        method: str | None = None,
        profile: str | None = None,
        name: str | None = None,
    ) -> MethodReport:
        """Run it from the first frame to the last.

        Args:
            segmenter: finds the objects for the method; the true masks, with the scenario's faults, unless given.
            mask: a function of colour (H, W, 3) uint8 RGB, depth (H, W) float32 metres and the stamp in seconds that
                says what to hide, (H, W) bool, in place of segmenter and method; see
                `scenarios.given_masks.MaskChoice`.
            slam: makes the SLAM back end from the camera and the true pose (4, 4) `T_world_camera` of the first frame,
                for example its class; the embedded one unless given.
            method: of `scenarios.run.METHODS`: `dotmask` unless given, `mdi` removes all objects, `unmasked` none.
            profile: of the method's parameters: `calibrated` unless given.
            name: of this run in the baseline; needed where a test runs something twice. As the method unless given.

        Returns:
            All figures, as `methods.NAME` in report.json. The run folder lies in the test's temporary folder, under
            the name of the run.

        Raises:
            ScenarioError: arguments that do not fit together, or what the part answers is not possible.
        """
        if mask is not None:
            for what, given in (("segmenter", segmenter), ("method", method), ("profile", profile)):
                if given is not None:
                    raise ScenarioError(f"dotmask_run: give mask= or {what}=, not both: a mask needs no {what}")
        chosen = MASK if mask is not None else method or "dotmask"
        if mask is None and chosen not in METHODS:
            raise unknown("method", chosen, METHODS)
        name = name or chosen
        if Path(name).name != name:
            raise ScenarioError(f"dotmask_run: name={name!r}: it is a folder's name too, so without a slash")
        if any(run["name"] == name for run in self._recorded):
            raise ScenarioError(f"dotmask_run: this test has a run '{name}' already; give one of them another name=")
        profile = profile or "calibrated"
        settings = RunSettings(
            methods=(chosen,),
            segmenter=_called(segmenter, "none" if mask is not None else "oracle"),
            slam=_called(slam, "embedded"),
            profile=profile,
            pose_feedback=get_profile(profile).pose_feedback,
            renderer=RENDERER,
            threads=self._frames.threads,
            video=False,
        )
        parts = Parts(
            segmenter=segmenter,
            front_end=None if mask is None else lambda camera: ChosenMasks(mask, camera),
            slam=slam,
        )
        report = run_source(self._frames.source(), settings, self._folder / name, lambda: None, parts)
        measured = report.methods[chosen]
        run = RunFigures(
            test=self._test,
            name=name,
            scenario=report.scenario,
            seed=self._frames.scenario.seed,
            frame_hash=report.frame_hash,
            version=importlib.metadata.version("dotmask"),
            figures=figures(measured, report.frames),
        )
        self._recorded.append(run.model_dump(mode="json"))
        told = {"frame_hash": run.frame_hash, **run.figures}
        self._properties += [(f"dotmask.{name}.{key}", value) for key, value in told.items() if value is not None]
        return measured


def _called(part: Any, otherwise: str) -> str:
    """What the report calls a part of the user's."""
    if part is None:
        return otherwise
    return str(getattr(part, "__qualname__", type(part).__qualname__))
