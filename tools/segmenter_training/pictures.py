"""What a person can look at: a sheet of frames with their masks and depth, and the loss over the steps."""

import csv
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.atomic_file import write_atomically
from scenarios.plots import GREY, ORANGE, figure_file
from sim.randomness import child
from tools.segmenter_training.augmentation import changed, draw_change
from tools.segmenter_training.frames import LabelledFrame
from tools.segmenter_training.state import Settings
from tools.segmenter_training.training import LOSSES, Frames

SHEET, CURVE = "frames.png", "losses.png"
COLUMNS, GROUPS = 6, 3
COLOURS = ((235, 70, 60), (70, 150, 255), (70, 220, 90), (250, 210, 50))
"""Of person, chair, cup and bottle."""


def write_sheet(frames: Frames, settings: Settings, path: Path) -> None:
    """A PNG of frames spread over all: by turns a row as rendered, as the network is taught them, and of its depth."""
    chosen = np.linspace(0, len(frames) - 1, COLUMNS * GROUPS).round().astype(int).tolist()
    rows: list[npt.NDArray[np.uint8]] = []
    for first in range(0, len(chosen), COLUMNS):
        plain = [frames[index] for index in chosen[first : first + COLUMNS]]
        taught = []
        for index, frame in zip(chosen[first : first + COLUMNS], plain, strict=True):
            rng = child(settings.seed, "segmenter sheet", index)
            taught.append(changed(frame, draw_change(rng, *frame.labels.shape), rng))
        rows += [np.hstack([drawn(frame) for frame in group]) for group in (plain, taught)]
        rows.append(np.hstack([depth_drawn(frame) for frame in taught]))
    _, encoded = cv2.imencode(".png", np.vstack(rows)[..., ::-1])
    write_atomically(path, encoded.tobytes())


def drawn(frame: LabelledFrame) -> npt.NDArray[np.uint8]:
    """The picture (H, W, 3) with every mask tinted in the colour of its class, and its border drawn."""
    image = frame.rgb.copy()
    for label, class_index in enumerate(frame.classes, start=1):
        mask = frame.labels == label
        image[mask] = (0.65 * image[mask] + 0.35 * np.array(COLOURS[class_index])).astype(np.uint8)
        borders, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(image, borders, -1, COLOURS[class_index], 1)
    return image


def depth_drawn(frame: LabelledFrame) -> npt.NDArray[np.uint8]:
    """The inverse depth (H, W, 3) from blue, far, to red, half a metre and nearer; black without a return."""
    depth_m = frame.depth_mm / 1000
    nearness = np.where(depth_m > 0, 0.5 / np.maximum(depth_m, 0.5), 0.0)
    image = cv2.applyColorMap((255 * nearness).round().astype(np.uint8), cv2.COLORMAP_TURBO)[..., ::-1]
    image[depth_m == 0] = 0
    return image.astype(np.uint8)


def write_curve(folder: Path) -> None:
    """A PNG of the losses by step, from LOSSES in the folder."""
    with (folder / LOSSES).open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    steps: Sequence[int] = [int(row[0]) for row in rows]
    with figure_file(folder / CURVE, 7.0, 4.0) as figure:
        axes = figure.add_subplot()
        for column, name in enumerate(header[1:], start=1):
            is_sum = name == "sum"
            values = [float(row[column]) for row in rows]
            axes.plot(steps, values, label=name, color=ORANGE if is_sum else None, linewidth=1.6 if is_sum else 0.9)
        axes.set_yscale("log")
        axes.set_xlabel("step")
        axes.set_ylabel("weighted loss")
        axes.grid(color=GREY, alpha=0.2)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(header) - 1, frameon=False)
