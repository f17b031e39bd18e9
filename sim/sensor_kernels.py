"""The inner loop of the sensor model. Compiled by numba; strict IEEE arithmetic, no libm, no global generator."""

# mypy: ignore-errors
# (numba infers the types of this function from its arguments; numpy's own annotations do not describe it)

import numpy as np
from numba import njit

f32 = np.float32
u64 = np.uint64


@njit(cache=True, nogil=True, error_model="numpy")
def measure(
    rgb,
    depth,
    edge,
    key,
    axial_table,
    lateral_table,
    colour_table,
    sigma_floor,
    sigma_growth,
    sigma_origin,
    disparity_scale,
    low,
    high,
    steps_per_metre,
    out_rgb,
    out_depth,
):
    """Noisy colour and depth.

    Each pixel has 64 random bits: the finaliser of SplitMix64 (Steele, Lea, Flood 2014) over `key` plus the pixel's
    number times the golden ratio. They index three tables of Gaussian quantiles: 11 bits for each colour channel, 9
    bits for each lateral axis, 13 bits for the depth.

    `edge` (H, W) marks the pixels that give no depth. `disparity_scale` is focal length times baseline over the
    disparity step, 0 = no such quantisation; `steps_per_metre` 0 = no rounding of the result.
    """
    height, width = depth.shape
    for y in range(height):
        for x in range(width):
            bits = key + u64(y * width + x) * u64(0x9E3779B97F4A7C15)
            bits = (bits ^ (bits >> u64(30))) * u64(0xBF58476D1CE4E5B9)
            bits = (bits ^ (bits >> u64(27))) * u64(0x94D049BB133111EB)
            bits = bits ^ (bits >> u64(31))
            red = np.int64(rgb[y, x, 0]) + colour_table[bits & u64(2047)]
            green = np.int64(rgb[y, x, 1]) + colour_table[(bits >> u64(11)) & u64(2047)]
            blue = np.int64(rgb[y, x, 2]) + colour_table[(bits >> u64(22)) & u64(2047)]
            out_rgb[y, x, 0] = min(max(red, 0), 255)
            out_rgb[y, x, 1] = min(max(green, 0), 255)
            out_rgb[y, x, 2] = min(max(blue, 0), 255)

            source_x = x + lateral_table[(bits >> u64(33)) & u64(511)]
            source_y = y + lateral_table[(bits >> u64(42)) & u64(511)]
            source_x = min(max(source_x, 0), width - 1)
            source_y = min(max(source_y, 0), height - 1)
            z = depth[source_y, source_x]
            if z <= f32(0) or edge[source_y, source_x]:
                out_depth[y, x] = f32(0)
                continue
            away = z - sigma_origin
            z += axial_table[bits >> u64(51)] * (sigma_floor + sigma_growth * away * away)
            if disparity_scale > f32(0):
                z = disparity_scale / np.floor(max(disparity_scale / z + f32(0.5), f32(1)))
            if not low <= z <= high:
                out_depth[y, x] = f32(0)
                continue
            if steps_per_metre > 0.0:
                z = f32(np.floor(np.float64(z) * steps_per_metre + 0.5) / steps_per_metre)
            out_depth[y, x] = z
