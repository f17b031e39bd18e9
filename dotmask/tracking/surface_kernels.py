"""The inner loops over the points on surfaces: whose they are, where they lie, what holds them. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def owners(pixels, frames, masks, scale, border_px):
    """The detection that each point lies on, the last of several; -1 for none: (N,) intp.

    Args:
        pixels: (N, 2) float32 u, v in an image `scale` times smaller than the masks.
        frames: (D, 4) intp first and last column, first and last row of that image where each detection may own points.
        masks: (D, H, W) bool; every `scale`-th pixel of every `scale`-th row is looked at.
        scale: see above.
        border_px: a point keeps so far from what is not its mask, in all directions.
    """
    found = np.full(len(pixels), -1, np.intp)
    for n in range(len(pixels)):
        u, v = int(np.rint(pixels[n, 0])), int(np.rint(pixels[n, 1]))
        for d in range(len(masks) - 1, -1, -1):
            first, last, top, bottom = frames[d]
            is_inside = first + border_px <= u <= last - border_px and top + border_px <= v <= bottom - border_px
            for y in range(v - border_px, v + border_px + 1):
                for x in range(u - border_px, u + border_px + 1):
                    is_inside = is_inside and masks[d, scale * y, scale * x]
            if is_inside:
                found[n] = d
                break
    return found


@njit(cache=True, nogil=True)
def steady_depth(pixels, depth_m, step_m, least_neighbours):
    """(N,) metres: the mean over the 3x3 neighbours on the same surface; 0 where too few are, or there is no depth.

    Args:
        pixels: (N, 2) u, v; at the image's border the nearest pixel inside of it is taken.
        depth_m: (H, W) float32.
        step_m: what differs by less from the pixel itself is on the same surface.
        least_neighbours: how many must be, the pixel itself among them.
    """
    height, width = depth_m.shape
    steady = np.zeros(len(pixels))
    for n in range(len(pixels)):
        u = min(max(int(np.rint(pixels[n, 0])), 1), width - 2)
        v = min(max(int(np.rint(pixels[n, 1])), 1), height - 2)
        centre, total, count = float(depth_m[v, u]), 0.0, 0
        for y in range(v - 1, v + 2):
            for x in range(u - 1, u + 2):
                depth = float(depth_m[y, x])
                if depth > 0 and abs(depth - centre) < step_m:
                    total += depth
                    count += 1
        if centre > 0 and count >= least_neighbours:
            steady[n] = total / count
    return steady


@njit(cache=True, nogil=True)
def is_held(grey, pixels, reach_px, least):
    """(N,) bool: whether the window around each pixel holds it in all directions; on a stripe it would slide along.

    The smaller eigenvalue of the matrix of Harris and Stephens (1988), summed over the window, must be above a share of
    the larger.

    Args:
        grey: (h, w) uint8.
        pixels: (N, 2) u, v.
        reach_px: the window goes so far to each side, and stays in the image.
        least: the share.
    """
    height, width = grey.shape
    held = np.zeros(len(pixels), np.bool_)
    for n in range(len(pixels)):
        u = min(max(int(np.rint(pixels[n, 0])), reach_px + 1), width - 2 - reach_px)
        v = min(max(int(np.rint(pixels[n, 1])), reach_px + 1), height - 2 - reach_px)
        xx, yy, xy = 0, 0, 0
        for y in range(v - reach_px, v + reach_px + 1):
            for x in range(u - reach_px, u + reach_px + 1):
                across = int(grey[y, x + 1]) - int(grey[y, x - 1])
                down = int(grey[y + 1, x]) - int(grey[y - 1, x])
                xx += across * across
                yy += down * down
                xy += across * down
        # Eigenvalues of [[xx, xy], [xy, yy]]: m -+ d.
        m, d = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), float(xy))
        held[n] = m - d > least * (m + d)
    return held


@njit(cache=True, nogil=True)
def _in_camera(T_world_camera, p_world):
    """x, y, z in the camera frame."""
    x, y, z = p_world[0] - T_world_camera[0, 3], p_world[1] - T_world_camera[1, 3], p_world[2] - T_world_camera[2, 3]
    return (
        T_world_camera[0, 0] * x + T_world_camera[1, 0] * y + T_world_camera[2, 0] * z,
        T_world_camera[0, 1] * x + T_world_camera[1, 1] * y + T_world_camera[2, 1] * z,
        T_world_camera[0, 2] * x + T_world_camera[1, 2] * y + T_world_camera[2, 2] * z,
    )


@njit(cache=True, nogil=True)
def object_motions(
    pixels, p_camera, owner, past_world, past_pixels, elapsed_s, thresholds_m_s, T_world_camera, lens, noise, most_lag
):
    """How the points of each of D objects moved: counts, and the median of their velocities.

    A point moves if it is not where it would be seen had it stood still since it was first followed, or for half of
    that time: it left that pixel by more than the flow's noise, and faster than the threshold. Its velocity is that
    since `most_lag` frames ago, or since it was first followed.

    Args:
        pixels: (N, 2) u, v of the points, full size image.
        p_camera: (N, 3) metres, camera frame.
        owner: (N,) which object each is on.
        past_world: (N, K, 3) where they were in the frames before, the latest first, metres; NaN: not followed yet.
        past_pixels: (N, K, 2) u, v then, full size image.
        elapsed_s: (K,) since those frames.
        thresholds_m_s: (D,) for each object.
        T_world_camera: (4, 4).
        lens: fx, fy, cx, cy.
        noise: of the flow, pixels; its share of the way in the image; how many sigmas are more than noise.
        most_lag: see above.

    Returns:
        points (D,), of which move (D,), mean lag (D,) in frames and (D,) in seconds, median velocity (D, 3) in camera
        axes, metres per second, and median distance from it (D, 3); of points that were seen before.
    """
    fx, fy, cx, cy = lens
    sigma_px, sigma_share, sigmas = noise
    objects = len(thresholds_m_s)
    counts, moving = np.zeros(objects, np.intp), np.zeros(objects, np.intp)
    lags, lags_s = np.zeros(objects), np.zeros(objects)
    velocities = np.empty((objects, 3, len(pixels)))
    for n in range(len(pixels)):
        age = 0
        while age < past_world.shape[1] and np.isfinite(past_world[n, age, 0]):
            age += 1
        if age == 0:
            continue
        d = owner[n]
        is_moving = False
        for ago in (age - 1, (age - 1) // 2):
            x, y, z = _in_camera(T_world_camera, past_world[n, ago])
            if z > 0:
                left = np.hypot(pixels[n, 0] - (fx * x / z + cx), pixels[n, 1] - (fy * y / z + cy))
                way = np.hypot(pixels[n, 0] - past_pixels[n, ago, 0], pixels[n, 1] - past_pixels[n, ago, 1])
                is_left = left > sigmas * (sigma_px + sigma_share * way)
                is_moving |= is_left and left * p_camera[n, 2] / fx / elapsed_s[ago] > thresholds_m_s[d]
        lag = min(age, most_lag) - 1
        # The way in camera axes: where the point is now, less where it would be had it stood still.
        x, y, z = _in_camera(T_world_camera, past_world[n, lag])
        velocities[d, 0, counts[d]] = (p_camera[n, 0] - x) / elapsed_s[lag]
        velocities[d, 1, counts[d]] = (p_camera[n, 1] - y) / elapsed_s[lag]
        velocities[d, 2, counts[d]] = (p_camera[n, 2] - z) / elapsed_s[lag]
        counts[d] += 1
        moving[d] += is_moving
        lags[d] += lag
        lags_s[d] += elapsed_s[lag]
    middles, spreads = np.zeros((objects, 3)), np.zeros((objects, 3))
    for d in range(objects):
        if counts[d]:
            lags[d] /= counts[d]
            lags_s[d] /= counts[d]
            for axis in range(3):
                along = velocities[d, axis, : counts[d]]
                middles[d, axis] = np.median(along)
                spreads[d, axis] = np.median(np.abs(along - middles[d, axis]))
    return counts, moving, lags, lags_s, middles, spreads
