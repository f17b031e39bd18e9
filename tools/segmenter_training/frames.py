"""The frames of a training on disk, rendered once: colour, depth, and which instance of a class each pixel shows.

A scene is four files: `00012.rgb.npy` (F, H, W, 3) uint8, `00012.depth_mm.npy` (F, H, W) uint16,
`00012.labels.npy` (F, H, W) uint8, and `00012.json`, which is written last and names the class of each label. Label 0
is everything else.
"""

import io
import json
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.atomic_file import write_atomically
from dotmask.segmentation.yolact.images import stretched
from sim.randomness import child
from sim.records import RenderedImages
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.sensor.parameters import SENSORS
from tools.segmenter_training.errors import TrainingError
from tools.segmenter_training.scenes import TrainingScene, build_scene, draw_moment

FRAMES_A_SCENE = 24
TRIES = 4
"""A view in which the target is hidden is drawn again, so many times."""
LEAST_SHOWN_PX = 40
NEAREST_M = 0.3
"""A view is drawn again as well if a quarter of it is nearer: a shelf before the lens."""
SENSOR_NAMES = ("kinect_v1", "realsense_d435")
"""Each frame is taken through one of them."""
IMAGES = ("rgb", "depth_mm", "labels")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledFrame:
    """One frame.

    Attributes:
        rgb: (H, W, 3) uint8.
        depth_mm: (H, W) uint16, millimetres, 0 = no return.
        labels: (H, W) uint8: 0, or the number of an instance.
        classes: class number of label 1, 2 and so on.
    """

    rgb: npt.NDArray[np.uint8]
    depth_mm: npt.NDArray[np.uint16]
    labels: npt.NDArray[np.uint8]
    classes: tuple[int, ...]


def render_frames(seed: int, number: int, count: int) -> list[LabelledFrame]:
    """`count` frames of scene `number`: a pure function of the arguments."""
    drawn = build_scene(seed, number)
    renderer = VisibilityBufferRenderer(drawn.scene, drawn.camera)
    return [_frame(drawn, renderer, child(seed, "segmenter frame", number, index)) for index in range(count)]


def _frame(drawn: TrainingScene, renderer: VisibilityBufferRenderer, rng: np.random.Generator) -> LabelledFrame:
    ids = {actor.name: actor.instance_id for actor in drawn.scene.actors}
    for _ in range(TRIES):
        moment, target = draw_moment(drawn, rng)
        images = renderer.render(moment, normals=True)
        is_shown = target is None or np.count_nonzero(images.instance_ids == ids[target]) >= LEAST_SHOWN_PX
        if is_shown and float(np.percentile(images.depth_m, 25)) > NEAREST_M:
            break
    sensor = SENSORS[SENSOR_NAMES[int(rng.integers(len(SENSOR_NAMES)))]].model
    rgb, depth_m = sensor.measure(images, drawn.camera, int(rng.integers(2**31)), 0)
    return halved(labelled(replace(images, rgb=rgb, depth_m=depth_m), drawn.classes))


def labelled(images: RenderedImages, class_of_id: Mapping[int, int]) -> LabelledFrame:
    """Images with their truth as a frame of the training; labels follow the order of the instance ids.

    Args:
        images: of any size.
        class_of_id: class number of the instance ids of a class.
    """
    shown = np.unique(images.instance_ids)
    known = [int(number) for number in shown if int(number) in class_of_id]
    table = np.zeros(int(shown.max()) + 1, np.uint8)
    table[known] = np.arange(1, len(known) + 1, dtype=np.uint8)
    return LabelledFrame(
        rgb=images.rgb,
        depth_mm=whole_mm(1e3 * images.depth_m),
        labels=table[images.instance_ids],
        classes=tuple(class_of_id[number] for number in known),
    )


def whole_mm(depth_mm: npt.NDArray[np.floating]) -> npt.NDArray[np.uint16]:
    """Depths of a frame, rounded; what is too far for 16 bits is as far as they reach."""
    return np.rint(np.minimum(depth_mm, np.iinfo(np.uint16).max)).astype(np.uint16)


def halved(frame: LabelledFrame) -> LabelledFrame:
    """A frame of half the height and width, colour and depth as the network is given them.

    A pixel has the label of most of its four, and the largest of two that have two each.
    """
    height, width = (size // 2 for size in frame.labels.shape)
    four = np.sort(frame.labels.reshape(height, 2, width, 2).transpose(0, 2, 1, 3).reshape(height, width, 4), axis=2)
    return LabelledFrame(
        rgb=np.asarray(cv2.resize(frame.rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8),
        depth_mm=stretched(frame.depth_mm, height, width),
        labels=np.where(four[..., 2] == four[..., 3], four[..., 2], four[..., 1]),
        classes=frame.classes,
    )


class FrameStore:
    """A folder of frames.

    Args:
        folder: that holds them; made where it is missing.
        seed: of the training.
        scenes: how many there are.
        frames_a_scene: of each.

    Attributes:
        frames_a_scene: of each.
    """

    def __init__(self, folder: Path, seed: int, scenes: int, frames_a_scene: int = FRAMES_A_SCENE) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.frames_a_scene = frames_a_scene
        self._folder, self._seed, self._scenes = folder, seed, scenes
        self._scene = lru_cache(maxsize=None)(self._opened)

    def __reduce__(self) -> tuple[type["FrameStore"], tuple[Path, int, int, int]]:
        return FrameStore, (self._folder, self._seed, self._scenes, self.frames_a_scene)

    def __len__(self) -> int:
        return self._scenes * self.frames_a_scene

    def __getitem__(self, index: int) -> LabelledFrame:
        """Frame `index`; its arrays are read from disk when they are used.

        Raises:
            TrainingError: its scene was not rendered, or its files are damaged.
        """
        number, frame = divmod(index, self.frames_a_scene)
        *images, classes = self._scene(number)
        rgb, depth_mm, labels = (np.asarray(image[frame]) for image in images)
        return LabelledFrame(rgb=rgb, depth_mm=depth_mm, labels=labels, classes=classes[frame])

    def missing(self) -> list[int]:
        """The scenes that are not on disk yet."""
        return [number for number in range(self._scenes) if not self._path(number, "json").is_file()]

    def render(self, processes: int, advance: Callable[[int], None]) -> None:
        """Render what is missing.

        Args:
            processes: how many work at the same time; the frames do not depend on it.
            advance: called with the number of frames after each scene.
        """
        missing = self.missing()
        if processes == 1 or len(missing) < 2:
            for number in missing:
                self.write(number, render_frames(self._seed, number, self.frames_a_scene))
                advance(self.frames_a_scene)
            return
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=_one_thread) as pool:
            waiting = [
                pool.submit(_render_and_write, self._folder, self._seed, n, self.frames_a_scene) for n in missing
            ]
            try:
                for done in as_completed(waiting):
                    done.result()
                    advance(self.frames_a_scene)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def write(self, number: int, frames: Iterable[LabelledFrame]) -> None:
        """Put the frames of a scene on disk."""
        made = list(frames)
        for name in IMAGES:
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.stack([getattr(f, name) for f in made]), allow_pickle=False)
            write_atomically(self._path(number, f"{name}.npy"), buffer.getvalue())
        write_atomically(self._path(number, "json"), json.dumps({"classes": [f.classes for f in made]}) + "\n")

    def _opened(self, number: int) -> tuple[Any, Any, Any, list[tuple[int, ...]]]:
        """The images of a scene in the order of IMAGES, still on disk, and the classes of each frame."""
        try:
            told = json.loads(self._path(number, "json").read_text(encoding="utf-8"))["classes"]
            rgb, depth_mm, labels = (
                np.load(self._path(number, f"{name}.npy"), mmap_mode="r", allow_pickle=False) for name in IMAGES
            )
        except (OSError, EOFError, ValueError, KeyError) as error:
            raise TrainingError(
                f"{self._path(number, 'json')}: scene {number} is missing or damaged ({error}); delete its files and "
                "run the same command again"
            ) from error
        return rgb, depth_mm, labels, [tuple(classes) for classes in told]

    def _path(self, number: int, suffix: str) -> Path:
        return self._folder / f"{number:05d}.{suffix}"


def _one_thread() -> None:
    cv2.setNumThreads(1)


def _render_and_write(folder: Path, seed: int, number: int, count: int) -> None:
    FrameStore(folder, seed, number + 1, count).write(number, render_frames(seed, number, count))
