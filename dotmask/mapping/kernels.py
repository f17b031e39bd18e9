"""Fusion of a view into blocks of signed distances: the inner loop of the mesh. Compiled by numba.

No fastmath and no threads: the same bytes every time.
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

f32 = np.float32


@njit(cache=True, nogil=True, error_model="numpy")
def fuse(depth_m, rgb, R, t, lens, origins, side, voxel_m, truncation_m, distance, weight, colour):
    """Add one view to all voxels that it sees.

    For a voxel whose centre lies at depth z on the ray of a pixel of depth d, the signed distance is d - z (in front of
    the surface: positive), cut off at the truncation; what lies deeper behind the surface is hidden and stays as it is.
    The weight is 1 / d^4 for d >= 1 m: the standard deviation of depth from a disparity grows with d^2.

    Args:
        depth_m: (H, W) float32, 0 = none.
        rgb: (H, W, 3) uint8.
        R: (3, 3) float32 camera from world.
        t: (3,) float32 camera from world.
        lens: fx, fy, cx, cy, float32.
        origins: (B, 3) float32 world position of the centre of each block's first voxel.
        side: voxels of a block along an axis.
        voxel_m: side of a voxel, float32.
        truncation_m: float32.
        distance: (B, side^3) float32, changed; mean signed distance over the truncation, -1..1.
        weight: (B, side^3) float32, changed; sum of the weights.
        colour: (B, side^3, 4) float32, changed; mean colour within the truncation, and its weight.
    """
    height, width = depth_m.shape
    fx, fy, cx, cy = lens
    radius = f32(0.5) * side * voxel_m * f32(1.7320508)
    for b in range(len(origins)):
        middle = f32(0.5) * (side - 1) * voxel_m
        mx, my, mz = origins[b, 0] + middle, origins[b, 1] + middle, origins[b, 2] + middle
        z = R[2, 0] * mx + R[2, 1] * my + R[2, 2] * mz + t[2]
        if z < -radius:
            continue
        if z > radius:  # else the block may be anywhere in the image
            x = R[0, 0] * mx + R[0, 1] * my + R[0, 2] * mz + t[0]
            y = R[1, 0] * mx + R[1, 1] * my + R[1, 2] * mz + t[1]
            near = z - radius
            margin = f32(2) * radius * max(fx, fy) / near
            u, v = fx * x / z + cx, fy * y / z + cy
            if u < -margin or v < -margin or u > width + margin or v > height + margin:
                continue
        for i in range(side):
            for j in range(side):
                for k in range(side):
                    px = origins[b, 0] + i * voxel_m
                    py = origins[b, 1] + j * voxel_m
                    pz = origins[b, 2] + k * voxel_m
                    z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2]
                    if z <= f32(0.05):
                        continue
                    x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0]
                    y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1]
                    column = int(np.floor(fx * x / z + cx + f32(0.5)))
                    row = int(np.floor(fy * y / z + cy + f32(0.5)))
                    if column < 0 or row < 0 or column >= width or row >= height:
                        continue
                    d = depth_m[row, column]
                    if d <= f32(0):
                        continue
                    signed = d - z
                    if signed < -truncation_m:
                        continue
                    at_least_1 = max(d, f32(1))
                    w = f32(1) / (at_least_1 * at_least_1 * at_least_1 * at_least_1)
                    n = (i * side + j) * side + k
                    total = weight[b, n] + w
                    share = w / total
                    distance[b, n] += share * (min(signed / truncation_m, f32(1)) - distance[b, n])
                    weight[b, n] = total
                    if signed <= truncation_m:
                        colour[b, n, 3] += w
                        share = w / colour[b, n, 3]
                        for c in range(3):
                            colour[b, n, c] += share * (f32(rgb[row, column, c]) - colour[b, n, c])
