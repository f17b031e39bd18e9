"""Render a scenario into a folder, frame by frame, so that it can be interrupted and continued."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from dotmask.partial_folder import PartialFolder
from scenarios.errors import ScenarioError, unknown
from scenarios.export.coco import CocoExport
from scenarios.export.kitti import KittiExport
from scenarios.export.truth import TruthFiles
from scenarios.export.tum import TumExport
from scenarios.export.video import VideoExport
from scenarios.run_folder import versions
from scenarios.sources import rendered_ahead
from scenarios.spec import Scenario
from scenarios.world import build_simulator
from sim.records import SimFrame
from sim.simulator import Simulator


class Export(Protocol):
    """Writes one kind of files of a folder."""

    def begin(self) -> None:
        """Before the first frame; not when a folder is continued."""
        ...

    def add(self, frame: SimFrame) -> None:
        """The next frame. What it writes depends on the frame alone, and not on those before."""
        ...

    def finish(self) -> None:
        """After the last frame. It may be called again when it was interrupted."""
        ...


FORMATS: Mapping[str, Callable[[PartialFolder, Simulator, Mapping[str, object]], Export]] = MappingProxyType(
    {"tum": TumExport, "coco": CocoExport, "kitti": KittiExport}
)


def render_sequence(
    scenario: Scenario,
    out: Path,
    *,
    format_name: str,
    renderer: str,
    threads: int,
    video: bool,
    resume: bool,
    show: Callable[[int], None],
) -> None:
    """Write the folder `out`; docs/export.md describes its files.

    It is called `.NAME.partial` until it is complete. When the rendering is interrupted or fails after the first frame,
    that folder stays and can be continued to the same bytes.

    Args:
        scenario: what happens.
        out: a new or empty folder.
        format_name: a key of FORMATS.
        renderer: name of the renderer.
        threads: of the renderer.
        video: whether to write `video.mp4` as well.
        resume: whether to continue an interrupted folder.
        show: called with the number of frames that are done, first of all with those done before.

    Raises:
        ScenarioError, SimError, DotmaskError: bad input, nothing to resume, or the disk cannot be written to.
    """
    if format_name not in FORMATS:
        raise unknown("format", format_name, FORMATS)
    settings: dict[str, Any] = {
        "scenario": scenario.model_dump(mode="json"),
        "format": format_name,
        "renderer": renderer,
        "video": video,
        "versions": versions(),
    }
    simulator = build_simulator(scenario, renderer, threads)
    folder = PartialFolder.resume(out, settings) if resume else PartialFolder.create(out, settings)
    facts = {
        "frame_rate_hz": scenario.frame_rate_hz,
        "sensor": scenario.sensor.model_dump(mode="json"),
        "renderer": renderer,
    }
    try:
        exports: list[Export] = [FORMATS[format_name](folder, simulator, facts), TruthFiles(folder.files, scenario)]
        if video:
            exports.append(VideoExport(folder, simulator, scenario.frame_rate_hz))
        if folder.steps == 0:
            for export in exports:
                export.begin()
        show(folder.steps)
        for timed in rendered_ahead(simulator, folder.steps):
            for export in exports:
                export.add(timed.frame)
            folder.commit()
            show(folder.steps)
        for export in exports:
            export.finish()
        folder.finish()
    except OSError as error:
        raise ScenarioError(f"cannot write {out}: {error.strerror}; make room, then continue with --resume") from error
    except BaseException:
        if folder.steps == 0:
            folder.discard()
        raise
