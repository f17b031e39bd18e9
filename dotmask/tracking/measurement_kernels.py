"""The inner loops of the measurement: depths under a mask, and what hides a side of it. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

BAND_PX = 8
"""How far outside a box an occluder is looked for: past the ring without depth that sensors leave at depth edges."""
RIM_PX = 3
"""Mask pixels this close to a side of the box are what that side rests on."""
LINES = 64
"""So many lines across a side are looked at."""
OTHER_MARGIN_M = 0.02
"""How much nearer another detection must be to count as an occluder."""


@njit(cache=True, nogil=True)
def sampled_depths(mask, depth_m, step, nearest_m, farthest_m):
    """(rows, columns) float32, the depth of every so many-th pixel of every so many-th row; 0 is none, or not the mask.

    Args:
        mask: (H, W) bool.
        depth_m: (H, W) float32.
        step: between the pixels.
        nearest_m: what lies outside of this and
        farthest_m: this is no depth.
    """
    rows, columns = (mask.shape[0] + step - 1) // step, (mask.shape[1] + step - 1) // step
    samples = np.zeros((rows, columns), np.float32)
    for i in range(rows):
        for j in range(columns):
            if mask[i * step, j * step]:
                depth = depth_m[i * step, j * step]
                if nearest_m <= depth <= farthest_m:
                    samples[i, j] = depth
    return samples


@njit(cache=True, nogil=True)
def median_depth(samples, step):
    """The upper median of depths, metres, and how many they are; 0 and 0 without any.

    Args:
        samples: (rows, columns) float32, 0 is none.
        step: every so many-th of every so many-th row is looked at.
    """
    depths = np.empty(samples.size, np.float32)
    count = 0
    for i in range(0, samples.shape[0], step):
        for j in range(0, samples.shape[1], step):
            if samples[i, j] > 0:
                depths[count] = samples[i, j]
                count += 1
    if count == 0:
        return 0.0, 0
    return float(np.partition(depths[:count], count // 2)[count // 2]), count


@njit(cache=True, nogil=True)
def mean_depth(samples, nearest_m, farthest_m):
    """How many depths there are, their mean (metres), and the sum of squares of the outline's about it (m²).

    The outline: samples of which one that touches by a side is missing.

    Args:
        samples: (rows, columns) float32, 0 is none.
        nearest_m: what lies outside of this and
        farthest_m: this does not count.
    """
    rows, columns = samples.shape
    is_used = np.zeros((rows + 2, columns + 2), np.bool_)
    pixels, total = 0, 0.0
    for i in range(rows):
        for j in range(columns):
            if samples[i, j] > 0 and nearest_m <= samples[i, j] <= farthest_m:
                is_used[i + 1, j + 1] = True
                pixels += 1
                total += samples[i, j]
    if pixels == 0:
        return 0, 0.0, 0.0
    mean, spread = total / pixels, 0.0
    for i in range(1, rows + 1):
        for j in range(1, columns + 1):
            if is_used[i, j] and not (
                is_used[i - 1, j] and is_used[i + 1, j] and is_used[i, j - 1] and is_used[i, j + 1]
            ):
                spread += (samples[i - 1, j - 1] - mean) ** 2
    return pixels, mean, spread


@njit(cache=True, nogil=True)
def hidden_objects(seen, crops, masks, depth_m, distances_m, margin_m, most_m):
    """Whether the image border, or something nearer, hides a side of each of the objects `seen`: (M,) bool.

    So it is where the box touches the border, where other detections that are nearer take more of the box than the
    object itself, or where most lines that reach a side of the box have something nearer right outside of it.

    Args:
        seen: (M,) which detections are meant.
        crops: (N, 4) u_start, u_stop, v_start, v_stop of all detections' boxes, whole pixels in the image.
        masks: (N, H, W) of all detections; where two overlap, the pixel belongs to the later one.
        depth_m: (H, W) float32.
        distances_m: (M,) depths of the objects.
        margin_m: how much nearer than an object something that is no detection must be to count as an occluder and not
            as the floor before its feet; grows with the distance.
        most_m: what lies farther away is no depth.
    """
    height, width = depth_m.shape
    hidden = np.ones(len(seen), np.bool_)
    for place, index in enumerate(seen):
        u0, u1, v0, v1 = crops[index]
        if u0 > 1 and v0 > 1 and u1 < width - 1 and v1 < height - 1:
            distance_m = distances_m[place]
            hidden[place] = _is_covered(index, crops, masks, depth_m, distance_m) or _ends_behind_occluder(
                index, crops, masks, depth_m, margin_m + 0.02 * distance_m**2, most_m
            )
    return hidden


@njit(cache=True, nogil=True)
def _near(index, crops, distance_px):
    """Other detections fewer than so many pixels away from a box."""
    near = np.empty(len(crops), np.intp)
    count = 0
    u0, u1, v0, v1 = crops[index]
    for j in range(len(crops)):
        a0, a1, b0, b1 = crops[j]
        is_empty = a0 >= a1 or b0 >= b1
        is_beside = u0 - distance_px < a1 and a0 - distance_px < u1 and v0 - distance_px < b1 and b0 - distance_px < v1
        if j != index and not is_empty and is_beside:
            near[count] = j
            count += 1
    return near[:count]


@njit(cache=True, nogil=True)
def _is_covered(index, crops, masks, depth_m, distance_m):
    """Whether other detections, nearer than the object, take more of its box than the object itself."""
    over = _near(index, crops, 0)
    if len(over) == 0:
        return False
    u0, u1, v0, v1 = crops[index]
    owned, covered = 0, 0
    for v in range(v0, v1, 1 + (v1 - v0) // LINES):
        for u in range(u0, u1, 1 + (u1 - u0) // LINES):
            is_own, is_others = masks[index, v, u], False
            for j in over:
                if masks[j, v, u]:
                    is_others = True
                    is_own = is_own and j < index
            if is_own:
                owned += 1
            elif is_others and 0 < depth_m[v, u] < distance_m:
                covered += 1
    return covered > owned


@njit(cache=True, nogil=True)
def _ends_behind_occluder(index, crops, masks, depth_m, margin_m, most_m):
    """Whether most lines that reach one of the four sides of a box have something nearer right outside of it.

    A line goes across a side, from `BAND_PX` outside to `RIM_PX` inside. What would lie outside the image is its
    border.
    """
    near = _near(index, crops, BAND_PX)
    u0, u1, v0, v1 = crops[index]
    for side in range(4):
        reaching, ending = 0, 0
        for line in range(LINES):
            along = (line + 0.5) / LINES
            column, row = u0 + int((u1 - u0) * along), v0 + int((v1 - v0) * along)
            own_m = np.float32(0.0)
            for inside in range(RIM_PX):
                u, v = _across(side, inside, column, row, u0, u1, v0, v1, depth_m.shape)
                is_own = masks[index, v, u] and depth_m[v, u] <= most_m
                for j in near:
                    is_own = is_own and not (j > index and masks[j, v, u])
                if is_own:
                    own_m = max(own_m, depth_m[v, u])
            if own_m <= 0:
                continue
            reaching += 1
            for outside in range(1, BAND_PX + 1):
                u, v = _across(side, -outside, column, row, u0, u1, v0, v1, depth_m.shape)
                margin = margin_m
                for j in near:
                    if masks[j, v, u]:
                        margin = OTHER_MARGIN_M
                if 0 < depth_m[v, u] < own_m - margin:
                    ending += 1
                    break
        if 2 * ending > reaching:
            return True
    return False


@njit(cache=True, nogil=True)
def _across(side, inside_px, column, row, u0, u1, v0, v1, size):
    """The pixel u, v so many pixels inside a side of a box (left, right, top, bottom), at a column or a row of it."""
    if side == 0:
        return max(u0 + inside_px, 0), row
    if side == 1:
        return min(u1 - 1 - inside_px, size[1] - 1), row
    if side == 2:
        return column, max(v0 + inside_px, 0)
    return column, min(v1 - 1 - inside_px, size[0] - 1)
