"""Anti-aliasing of edges in colour, from the visibility buffer. Compiled by numba, under the rules of `kernels`.

Two neighbouring pixels that show different surfaces have an edge between them. It is found exactly, as the edge of a
triangle and not from the colours (Persson, "Geometry buffer anti-aliasing", SIGGRAPH 2011): from the nearer pixel we
walk over its mesh towards the other one, from triangle to neighbouring triangle, until the mesh ends, bends sharply or
turns its back. The edge's line cuts each of the two pixels; the area beyond it takes the colour of the other pixel.
Depth and ids are left alone. Cost is per edge pixel, and what is smaller than a pixel still falls between the centres.
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

from sim.renderers.kernels import KERNEL, cross

f32 = np.float32

CONTRAST = 4
"""Pixels that differ by at most so many grey levels in every channel need no blending."""
MAX_STEPS = 24
"""Triangles in one walk; a mesh that is so much finer than a pixel is left as it is."""


@njit(**KERNEL)
def corner(camera, vertex):
    """Camera-frame position in float64."""
    return np.float64(camera[vertex, 0]), np.float64(camera[vertex, 1]), np.float64(camera[vertex, 2])


@njit(**KERNEL)
def outside_area(distance, slope_x, slope_y):
    """Share of a unit square beyond a line, by the line's function: `distance` >= 0 at the centre, and its slopes."""
    low, high = min(abs(slope_x), abs(slope_y)), max(abs(slope_x), abs(slope_y))
    reach = 0.5 * (low + high) - distance
    if reach <= 0.0:
        return f32(0)
    if reach < low:  # a corner alone
        return f32(reach * reach / (2.0 * low * high))
    return f32((reach - 0.5 * low) / high)


@njit(**KERNEL)
def walk(camera, faces, neighbours, t, goal, ray_x, ray_y, step_x, step_y):
    """Where the mesh of face `t` ends on the way from the ray (ray_x, ray_y, 1) to that ray plus the step.

    Returns:
        The share of the step, below 1 where there is an edge, 1 where the mesh reaches the end, 2 where it reaches the
        face `goal`; and the edge's line as a function of the ray (x, y, 1), positive on the side of the start.
    """
    line_x = line_y = line_1 = 0.0
    share = 1.0
    for step in range(MAX_STEPS):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = corner(camera, i)
        bx, by, bz = corner(camera, j)
        gx, gy, gz = corner(camera, k)
        e0x, e0y, e0z = cross(bx, by, bz, gx, gy, gz)
        if step > 0 and ax * e0x + ay * e0y + az * e0z >= 0.0:  # seen from behind: the last edge is the outline
            return share, line_x, line_y, line_1
        e1x, e1y, e1z = cross(gx, gy, gz, ax, ay, az)
        e2x, e2y, e2z = cross(ax, ay, az, bx, by, bz)
        share, side = 1.0, -1
        for n in range(3):
            if n == 0:
                ex, ey, ez = -e0x, -e0y, -e0z
            elif n == 1:
                ex, ey, ez = -e1x, -e1y, -e1z
            else:
                ex, ey, ez = -e2x, -e2y, -e2z
            slope = ex * step_x + ey * step_y
            if slope < 0.0:
                crossing = (ex * ray_x + ey * ray_y + ez) / -slope
                if crossing < share:
                    share, side, line_x, line_y, line_1 = crossing, n, ex, ey, ez
        if side < 0:
            return 1.0, line_x, line_y, line_1
        share = max(share, 0.0)
        across = neighbours[t, side]
        if across < 0:
            return share, line_x, line_y, line_1
        if across == goal:
            return 2.0, line_x, line_y, line_1
        t = across
    return 1.0, line_x, line_y, line_1


@njit(**KERNEL)
def inverse_depth_plane(camera, faces, t):
    """1/z of a face as a function of the ray (x, y, 1)."""
    ax, ay, az = corner(camera, faces[t, 0])
    bx, by, bz = corner(camera, faces[t, 1])
    gx, gy, gz = corner(camera, faces[t, 2])
    e0x, e0y, e0z = cross(bx, by, bz, gx, gy, gz)
    e1x, e1y, e1z = cross(gx, gy, gz, ax, ay, az)
    e2x, e2y, e2z = cross(ax, ay, az, bx, by, bz)
    scale = 1.0 / (ax * e0x + ay * e0y + az * e0z)
    return (e0x + e1x + e2x) * scale, (e0y + e1y + e2y) * scale, (e0z + e1z + e2z) * scale


@njit(**KERNEL)
def find_steps(triangles, colours, first, second, found):
    """Set `found` where the pixels from `first` and those from `second` on (flat) show two triangles and two colours.

    Colours are 0x00bbggrr. The loop has no branch, so that it becomes vector instructions.
    """
    for x in range(len(found)):
        n, m = first + np.uint64(x), second + np.uint64(x)
        a, b = colours[n], colours[m]
        red = np.int32(a & 255) - np.int32(b & 255)
        green = np.int32((a >> 8) & 255) - np.int32((b >> 8) & 255)
        blue = np.int32((a >> 16) & 255) - np.int32((b >> 16) & 255)
        found[x] = (triangles[n] != triangles[m]) & (
            (abs(red) > CONTRAST) | (abs(green) > CONTRAST) | (abs(blue) > CONTRAST)
        )


@njit(**KERNEL)
def shares(camera, faces, neighbours, fx, fy, s, t, ray_x, ray_y, far_x, far_y):
    """What the pixel of face `s` and the farther pixel of face `t` beside it take from each other, by their rays."""
    nothing = f32(0), f32(0)
    share, line_x, line_y, line_1 = walk(camera, faces, neighbours, s, t, ray_x, ray_y, far_x - ray_x, far_y - ray_y)
    if share == 1.0:  # the nearer surface goes on behind the other pixel
        if t < 0:
            return nothing
        share, line_x, line_y, line_1 = walk(
            camera, faces, neighbours, t, s, far_x, far_y, ray_x - far_x, ray_y - far_y
        )
        if share == 1.0:  # so does the other one: they cut through each other
            share = 0.0
            nx, ny, nz = inverse_depth_plane(camera, faces, s)
            mx, my, mz = inverse_depth_plane(camera, faces, t)
            line_x, line_y, line_1 = nx - mx, ny - my, nz - mz
    if share > 1.0:  # one smooth surface
        return nothing
    slope_x, slope_y = line_x / fx, line_y / fy
    near = abs(line_x * ray_x + line_y * ray_y + line_1)
    far = abs(line_x * far_x + line_y * far_y + line_1)
    if not (near + far > 0.0 and near + far < 1.001 * (abs(slope_x) + abs(slope_y))):
        return nothing  # no line between the two
    return outside_area(near, slope_x, slope_y), outside_area(far, slope_x, slope_y)


@njit(**KERNEL)
def blend_edges(
    camera,
    faces,
    neighbours,
    fx,
    fy,
    cx,
    cy,
    triangles,
    inverse_depth,
    colour,
    row_first,
    row_last,
    rgb,
):
    """Fill the rows row_first..row_last-1 of `rgb` (H, W, 3) from `colour` (H, W), 0x00bbggrr, with edges blended.

    Reads one more row on each side.
    """
    height, width = triangles.shape
    half, zero = f32(0.5), f32(0)
    flat_t, flat_w, flat_c, target = triangles.ravel(), inverse_depth.ravel(), colour.ravel(), rgb.ravel()
    # Shares of a row's pixels: from the left, the right, above, below; and those from above of the next row.
    left, right = np.zeros(width, np.float32), np.zeros(width, np.float32)
    above, below, following = np.zeros(width, np.float32), np.zeros(width, np.float32), np.zeros(width, np.float32)
    found = np.zeros(width, np.bool_)
    for y in range(max(row_first - 1, 0), row_last):
        below[:], following[:], left[:], right[:] = zero, zero, zero, zero
        for direction in range(2):  # to the right, downwards
            if (direction == 0 and y < row_first) or (direction == 1 and y + 1 == height):
                continue
            step = np.uint64(1 if direction == 0 else width)
            ray_y, next_y = (y - cy) / fy, (y + direction - cy) / fy
            row = np.uint64(y * width)
            steps = found[: width - 1 + direction]
            find_steps(flat_t, flat_c, row, row + step, steps)
            for x in range(width - 1 + direction):
                if not steps[x]:
                    continue
                n = row + np.uint64(x)
                s, t = flat_t[n], flat_t[n + step]
                if s >= 0 and (neighbours[s, 0] == t or neighbours[s, 1] == t or neighbours[s, 2] == t):
                    continue
                ray_x, next_x = (x - cx) / fx, (x + 1 - direction - cx) / fx
                if flat_w[n] >= flat_w[n + step]:
                    a, b = shares(camera, faces, neighbours, fx, fy, s, t, ray_x, ray_y, next_x, next_y)
                else:
                    b, a = shares(camera, faces, neighbours, fx, fy, t, s, next_x, next_y, ray_x, ray_y)
                if direction == 0:
                    right[x], left[x + 1] = a, b
                else:
                    below[x], following[x] = a, b
        if y >= row_first:
            for x in range(width):
                own = colour[y, x]
                rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = own & 255, (own >> 8) & 255, own >> 16
            for x in range(width):
                # A slanted edge is met in both directions, with the same area.
                across, along = left[x] + right[x], above[x] + below[x]
                if across + along == zero:
                    continue
                step = 1 if across >= along else width
                before, after = (left[x], right[x]) if across >= along else (above[x], below[x])
                n = y * width + x
                for c in range(3):
                    value = own = f32((flat_c[n] >> 8 * c) & 255)
                    if before > zero:
                        value += before * (f32((flat_c[n - step] >> 8 * c) & 255) - own)
                    if after > zero:
                        value += after * (f32((flat_c[n + step] >> 8 * c) & 255) - own)
                    target[3 * n + c] = np.uint8(value + half)
        above, following = following, above
