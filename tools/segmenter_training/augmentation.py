"""Frames as the network is taught with: moved, coloured, blurred and noisy, and what is to be found in them."""

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import torch

from dotmask.segmentation.yolact.loss import Target
from sim.randomness import child
from tools.segmenter_training.frames import LabelledFrame, whole_mm

LEAST_PX = 20
"""An instance with fewer pixels of the network's image is nothing to be found: the judge begins at 80 of 640x480."""
MASK_SHARE = 2
"""Masks have half of the image's height and width: as many pixels as the prototypes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What is done to a frame.

    Attributes:
        zoom: factor on sizes.
        turn_rad: about the middle of the image, counter-clockwise as seen.
        shift_px: of the middle, right and down.
        is_mirrored: left and right are swapped.
        gains, biases: on red, green and blue, grey levels.
        gamma: exponent on brightness.
        saturation: 0 is grey, 1 as it is.
        blur_px: length of the motion blur; below 2 there is none.
        blur_rad: its direction.
        noise: standard deviation of a channel, grey levels.
        late_px: by how much the depth lies beside the colour, right and down: cameras take them one after the other.
        has_depth: whether the camera gives any.
    """

    zoom: float = 1.0
    turn_rad: float = 0.0
    shift_px: tuple[float, float] = (0.0, 0.0)
    is_mirrored: bool = False
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    biases: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gamma: float = 1.0
    saturation: float = 1.0
    blur_px: int = 0
    blur_rad: float = 0.0
    noise: float = 0.0
    late_px: tuple[float, float] = (0.0, 0.0)
    has_depth: bool = True

    @property
    def moves(self) -> bool:
        """Whether pixels go elsewhere."""
        return self.is_mirrored or (self.zoom, self.turn_rad, *self.shift_px) != (1.0, 0.0, 0.0, 0.0)


def draw_change(rng: np.random.Generator, height: int, width: int) -> Change:
    """A random change of an image of this size."""
    zoom, turn, shift = 1.0, 0.0, (0.0, 0.0)
    if rng.random() < 0.6:
        zoom = math.exp(rng.uniform(math.log(0.5), math.log(1.7)))
        turn = float(rng.normal(0.0, math.radians(5.0)))
        reach = 0.05 + max(zoom - 1.0, 0.0) / 2  # an enlarged image stays about full
        shift = (float(rng.uniform(-reach, reach)) * width, float(rng.uniform(-reach, reach)) * height)
    brightness, contrast = rng.uniform(-12.0, 16.0), rng.uniform(0.8, 1.25)
    tint = contrast * rng.uniform(0.94, 1.06, 3)
    biases = brightness + rng.uniform(-5.0, 5.0, 3)
    return Change(
        zoom=zoom,
        turn_rad=turn,
        shift_px=shift,
        is_mirrored=bool(rng.random() < 0.5),
        gains=(float(tint[0]), float(tint[1]), float(tint[2])),
        biases=(float(biases[0]), float(biases[1]), float(biases[2])),
        gamma=math.exp(rng.uniform(math.log(0.85), math.log(1.18))),
        saturation=float(rng.uniform(0.7, 1.3)),
        blur_px=int(rng.integers(2, 9)) if rng.random() < 0.2 else 0,
        blur_rad=float(rng.uniform(0.0, math.pi)),
        noise=float(rng.uniform(0.0, 5.0)),
        late_px=(float(rng.normal(0.0, 1.5)), float(rng.normal(0.0, 1.5))) if rng.random() < 0.2 else (0.0, 0.0),
        has_depth=bool(rng.random() < 0.95),
    )


def changed(frame: LabelledFrame, change: Change, rng: np.random.Generator) -> LabelledFrame:
    """The frame after a change; where there was nothing it is grey, without depth and label.

    A frame that is zoomed is one from nearer: its depths shrink as its sizes grow.

    Args:
        frame: of the training.
        change: to make.
        rng: of the noise.
    """
    rgb, depth_mm, labels = frame.rgb, frame.depth_mm, frame.labels
    matrix = _matrix(change, *labels.shape)
    size = (labels.shape[1], labels.shape[0])
    if not change.has_depth:
        depth_mm = np.zeros_like(depth_mm)
    elif change.moves or change.late_px != (0.0, 0.0):
        late = np.column_stack([np.zeros((2, 2)), change.late_px])
        moved = cv2.warpAffine(depth_mm, matrix + late, size, flags=cv2.INTER_NEAREST, borderValue=0)
        depth_mm = whole_mm(moved / change.zoom)
    if change.moves:
        moved = cv2.warpAffine(rgb, matrix, size, flags=cv2.INTER_LINEAR, borderValue=(110, 110, 110))
        rgb = np.asarray(moved, np.uint8)
        labels = np.asarray(cv2.warpAffine(labels, matrix, size, flags=cv2.INTER_NEAREST, borderValue=0), np.uint8)
    return LabelledFrame(rgb=_seen(rgb, change, rng), depth_mm=depth_mm, labels=labels, classes=frame.classes)


def target_of(frame: LabelledFrame) -> Target:
    """What is to be found in a frame: every instance with at least LEAST_PX pixels."""
    height, width = frame.labels.shape
    counts = np.bincount(frame.labels.ravel(), minlength=len(frame.classes) + 1)
    found = [label for label in range(1, len(frame.classes) + 1) if counts[label] >= LEAST_PX]
    boxes = np.zeros((len(found), 4), np.float32)
    masks = np.zeros((len(found), height // MASK_SHARE, width // MASK_SHARE), np.float32)
    for row, label in enumerate(found):
        mask = np.equal(frame.labels, label).astype(np.uint8)
        left, top, across, down = cv2.boundingRect(mask)
        boxes[row] = left / width, top / height, (left + across) / width, (top + down) / height
        cv2.resize(
            mask.astype(np.float32), (masks.shape[2], masks.shape[1]), dst=masks[row], interpolation=cv2.INTER_AREA
        )
    return Target(
        boxes=torch.from_numpy(boxes),
        classes=torch.tensor([frame.classes[label - 1] for label in found], dtype=torch.int64),
        masks=torch.from_numpy(masks),
    )


def _matrix(change: Change, height: int, width: int) -> npt.NDArray[np.float64]:
    """(2, 3) from places in the frame to places in the changed one; pixel centres are whole numbers."""
    u, v = (width - 1) / 2, (height - 1) / 2
    cosine, sine = change.zoom * math.cos(change.turn_rad), change.zoom * math.sin(change.turn_rad)
    linear = np.array([[cosine, sine], [-sine, cosine]]) @ np.diag([-1.0 if change.is_mirrored else 1.0, 1.0])
    offset = np.array([u, v]) + change.shift_px - linear @ (u, v)
    return np.column_stack([linear, offset])


def _seen(rgb: npt.NDArray[np.uint8], change: Change, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Blur, colours and noise."""
    if change.blur_px > 1:
        rgb = np.asarray(cv2.filter2D(rgb, -1, _line(change.blur_px, change.blur_rad)), np.uint8)
    levels = np.float32(255.0) * np.linspace(0.0, 1.0, 256, dtype=np.float32) ** np.float32(change.gamma)
    mixing = change.saturation * np.eye(3) + (1 - change.saturation) / 3
    colours = np.column_stack([np.diag(change.gains) @ mixing, change.biases])
    image = cv2.transform(cv2.LUT(rgb, levels), colours)
    # A piece of a long row of normal deviates: to draw a quarter of a million would cost more than all the rest.
    deviates = _deviates(image.size)
    first = int(rng.integers(len(deviates) - image.size + 1))
    noise = deviates[first : first + image.size].reshape(image.shape)
    return np.asarray(cv2.addWeighted(image, 1.0, noise, change.noise, 0.0, dtype=cv2.CV_8U), np.uint8)


@lru_cache(maxsize=1)
def _deviates(size: int) -> npt.NDArray[np.float32]:
    """Eight times `size` normal deviates."""
    return child(0, "segmenter noise").standard_normal(8 * size, dtype=np.float32)


def _line(length_px: int, angle_rad: float) -> npt.NDArray[np.float32]:
    """A kernel that smears along a line through its middle."""
    size = length_px | 1
    kernel = np.zeros((size, size), np.float32)
    middle, reach = size // 2, (length_px - 1) / 2
    ends = [
        (round(middle + sign * reach * math.cos(angle_rad)), round(middle + sign * reach * math.sin(angle_rad)))
        for sign in (-1, 1)
    ]
    cv2.line(kernel, ends[0], ends[1], 1.0)
    return np.asarray(kernel / kernel.sum(), np.float32)
