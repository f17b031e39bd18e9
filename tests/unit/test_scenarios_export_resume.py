"""A render that is interrupted anywhere and continued has the same bytes as one that was not."""

import errno
import gc
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dotmask.partial_folder import GrowingFiles
from scenarios.errors import ScenarioError
from scenarios.export import render
from scenarios.export.render import FORMATS, render_sequence
from scenarios.spec import Scenario
from sim.geometry import look_at
from sim.records import CameraModel, GroundTruth, KeypointsTruth, ObjectTruth, SimFrame

CAMERA = CameraModel(width=32, height=16, fx=10.0, fy=11.0, cx=5.5, cy=4.25)
FRAMES = 4


def frame(index: int) -> SimFrame:
    rng = np.random.default_rng(index)
    ids = rng.choice([0, 1, 51], (16, 32)).astype(np.uint16)
    depth = rng.uniform(0.5, 9.0, (16, 32)).astype(np.float32)
    person = ObjectTruth(
        name="anton", class_name="person", instance_id=1, T_world_object=np.eye(4), centre_world=np.ones(3),
        velocity_world=np.ones(3), surface_speed_m_s=1.0, is_moving=True, visible_pixels=int((ids == 1).sum()),
        occlusion=0.0, is_truncated=True, ideal_world=None,
        keypoints=KeypointsTruth(
            world_m=rng.normal(size=(17, 3)), pixels=rng.normal(size=(17, 2)), visibility=np.full(17, 2, np.uint8)
        ),
    )  # fmt: skip
    return SimFrame(
        index=index,
        timestamp_s=index / 30,
        camera=CAMERA,
        rgb=rng.integers(0, 256, (16, 32, 3), dtype=np.uint8),
        depth_m=depth,
        truth=GroundTruth(
            T_world_camera=look_at([0, -2, 1.5], [index, 0, 1]), depth_m=depth, instance_ids=ids, objects=(person,)
        ),
    )


class ByHand:
    """Stands for a simulator."""

    camera = CAMERA
    scene = SimpleNamespace(
        objects=[SimpleNamespace(name="anton", class_name="person", instance_id=1)],
        actors=[SimpleNamespace(instance_id=1)],
    )

    def __init__(self, frames: int) -> None:
        self.frames = frames

    def __len__(self) -> int:
        return self.frames

    def frame(self, index: int) -> SimFrame:
        return frame(index)


@pytest.fixture(autouse=True)
def simulator_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render, "build_simulator", lambda scenario, renderer, threads: ByHand(scenario.frames))


def rendered(out: Path, format_name: str, *, resume: bool = False, frames: int = FRAMES,
             show: Callable[[int], None] = lambda done: None, video: bool = True) -> dict[str, bytes]:  # fmt: skip
    scenario = Scenario(name="made_by_hand", description="-", frames=frames)
    render_sequence(
        scenario, out, format_name=format_name, renderer="numba", threads=1, video=video, resume=resume, show=show
    )
    return {str(p.relative_to(out)): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()}


class PowerCut(BaseException):
    """Nothing catches it."""


class CutAt:
    """Lets `number` writes pass; of the next one only a half is written."""

    def __init__(self, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.left = number
        write, append = GrowingFiles.write, GrowingFiles.append
        monkeypatch.setattr(GrowingFiles, "write", lambda files, name, data: self.do(write, files, name, data))
        monkeypatch.setattr(GrowingFiles, "append", lambda files, name, data: self.do(append, files, name, data))

    def do(self, function: Callable[..., None], files: GrowingFiles, name: str, data: bytes | str) -> None:
        if self.left == 0:
            function(files, name, data[: len(data) // 2])
            raise PowerCut
        self.left -= 1
        function(files, name, data)


@pytest.mark.parametrize("format_name", FORMATS)
def test_interrupted_at_any_write_and_continued(format_name: str, tmp_path: Path) -> None:
    wanted = rendered(tmp_path / "whole", format_name)
    assert "video.mp4" in wanted
    cuts = kept = 0
    while True:
        out = tmp_path / f"cut{cuts}"
        with pytest.MonkeyPatch.context() as patch:
            CutAt(cuts, patch)
            try:
                rendered(out, format_name)
                break  # there are fewer writes than that
            except PowerCut:
                pass
        assert not out.exists(), "it looks complete"
        resume = out.with_name(f".{out.name}.partial").exists()
        kept += resume
        assert rendered(out, format_name, resume=resume) == wanted, f"cut at write {cuts}"
        cuts += 1
    assert cuts > 7 * FRAMES
    assert kept > 5 * FRAMES
    assert not [p.name for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_interrupted_twice(tmp_path: Path) -> None:
    wanted = rendered(tmp_path / "whole", "coco")

    def stop_at(number: int) -> Callable[[int], None]:
        def show(done: int) -> None:
            if done == number:
                raise KeyboardInterrupt

        return show

    with pytest.raises(KeyboardInterrupt):
        rendered(tmp_path / "out", "coco", show=stop_at(1))
    with pytest.raises(KeyboardInterrupt):
        rendered(tmp_path / "out", "coco", show=stop_at(3), resume=True)
    seen: list[int] = []
    assert rendered(tmp_path / "out", "coco", show=seen.append, resume=True) == wanted
    assert seen == [3, 4], "frames were rendered again"


def test_a_full_disk_is_one_line_and_can_be_continued(tmp_path: Path) -> None:
    wanted = rendered(tmp_path / "whole", "tum")

    def full(done: int) -> None:
        if done == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(ScenarioError, match="No space left on device; make room, then continue with --resume"):
        rendered(tmp_path / "out", "tum", show=full)
    assert rendered(tmp_path / "out", "tum", resume=True) == wanted


def test_memory_is_flat_in_the_number_of_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # One by one: how many frames are ahead at a moment is chance.
    monkeypatch.setattr(
        render, "rendered_ahead", lambda s, first: (SimpleNamespace(frame=s.frame(k)) for k in range(first, len(s)))
    )
    held: dict[int, int] = {}

    def show(done: int) -> None:
        if done in (40, 240, 440):
            gc.collect()
            # pathlib interns names, and the interpreter's table of those grows in jumps of megabytes.
            ours = tracemalloc.take_snapshot().filter_traces([tracemalloc.Filter(False, "*pathlib*")])
            held[done] = sum(trace.size for trace in ours.traces)

    for format_name in FORMATS:
        tracemalloc.start()
        rendered(tmp_path / format_name, format_name, frames=441, show=show)
        tracemalloc.stop()
        # A frame's images have 3 kB, and a single line of text a frame would be 20 kB in each half. What is kept
        # grows in both; the interpreter's free lists fill up, and its tables grow in jumps, in one of them.
        assert min(held[240] - held[40], held[440] - held[240]) < 12_500, format_name
