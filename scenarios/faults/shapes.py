"""Faults of the masks: grown, shrunk, merged, split."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from dotmask.mask_geometry import dilate
from dotmask.records import FloatArray, MaskImage
from scenarios.faults.found import Dice, Found, singles, together
from scenarios.oracle import outer_box
from scenarios.spec import BordersSpec, MergedSpec, SplitSpec

CUT_FROM, CUT_TO = 0.25, 0.75
"""A split lies between these parts of the longer side of the box."""


def borders(found: Found, spec: BordersSpec) -> Found:
    """Every mask grown or shrunk by a disc; the border of the image shrinks none."""
    if spec.pixels == 0:
        return found
    changed = [replace(one, mask=moved_border(one.mask, spec.pixels)) for one in singles(found)]
    return together(changed, found.detections.masks.shape[1:])


def moved_border(mask: MaskImage, pixels: int) -> MaskImage:
    """`mask` (H, W), not empty, with its border moved outwards by so many pixels; inwards where they are negative."""
    if pixels >= 0:
        return dilate(mask, pixels)
    u_min, v_min, u_max, v_max = outer_box(mask).astype(int)
    # A frame of one pixel around the box is as much of the outside as its nearest pixels need.
    region = slice(max(v_min - 1, 0), v_max + 2), slice(max(u_min - 1, 0), u_max + 2)
    shrunk = np.zeros_like(mask)
    shrunk[region] = ~dilate(~mask[region], -pixels)
    return shrunk


def merged(found: Found, spec: MergedSpec, dice: Dice) -> Found:
    """Pairs become one with the masks of both; each instance joins one other at most, the first that is drawn."""
    if spec.probability == 0:
        return found
    ones, partner = singles(found), {}
    for a, b in combinations(range(len(ones)), 2):
        if a in partner or b in partner or ones[a].class_name != ones[b].class_name:
            continue
        if not _touch(found.detections.boxes_px[a], found.detections.boxes_px[b]):
            continue
        if dice.throw("merged", f"{ones[a].name}+{ones[b].name}").random() < spec.probability:
            partner[a], partner[b] = b, a
    if not partner:
        return found
    left = [
        replace(
            one,
            mask=one.mask | ones[partner[index]].mask,
            score=max(one.score, ones[partner[index]].score),
        )
        if index in partner
        else one
        for index, one in enumerate(ones)
        if partner.get(index, index) >= index
    ]
    return together(left, found.detections.masks.shape[1:])


def _touch(one: FloatArray, other: FloatArray) -> bool:
    """Whether two boxes (u_min, v_min, u_max, v_max, inclusive) overlap or have neighbouring pixels."""
    return bool((one[:2] <= other[2:] + 1).all() and (other[:2] <= one[2:] + 1).all())


def split(found: Found, spec: SplitSpec, dice: Dice) -> Found:
    """The part with the lower rows or columns keeps the name; the other one follows it."""
    if spec.probability == 0:
        return found
    parts, is_changed = [], False
    for one, box in zip(singles(found), found.detections.boxes_px, strict=True):
        generator = dice.throw("split", one.name)
        width, height = box[2:] - box[:2]
        if max(width, height) < 1 or generator.random() >= spec.probability:
            parts.append(one)
            continue
        is_changed = True
        axis, first, length = (0, box[1], height) if height >= width else (1, box[0], width)
        # The first row of the box and its last one hold pixels of the mask: neither part is empty.
        cut = int(first + np.clip(np.round(generator.uniform(CUT_FROM, CUT_TO) * length), 1, length))
        is_before = np.expand_dims(np.arange(one.mask.shape[axis]) < cut, 1 - axis)
        parts += [
            replace(one, mask=one.mask & is_before),
            replace(one, name=f"{one.name}/2", mask=one.mask & ~is_before),
        ]
    return together(parts, found.detections.masks.shape[1:]) if is_changed else found
