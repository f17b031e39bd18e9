"""The inner loops of the sensor model. Compiled by numba; strict IEEE arithmetic, no libm, no global generator."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

f32 = np.float32
u64 = np.uint64

HOLE_PX = 4
"""Side of the patches that steep surfaces lose as a whole."""

QUANTILES = 8192
"""Entries of the table of Gaussian quantiles: 13 bits."""


@njit(cache=True, nogil=True, error_model="numpy")
def _mixed(bits):
    """The finaliser of SplitMix64 (Steele, Lea, Flood 2014): 64 well mixed bits."""
    bits = (bits ^ (bits >> u64(30))) * u64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> u64(27))) * u64(0x94D049BB133111EB)
    return bits ^ (bits >> u64(31))


@njit(cache=True, nogil=True, error_model="numpy")
def add_shadow(depth, disparity_at_1m, tolerance, lost):
    """Mark in `lost` what the projector or the second imager, to the right of the first, does not see.

    A point in column u lies in column `u - disparity_at_1m / z` of the other view. Each row is drawn there with a
    depth buffer; a point is lost if something nearer by more than the share `tolerance` covers its column.
    """
    height, width = depth.shape
    nearest = np.empty(2 * width + 1, np.float32)
    for y in range(height):
        nearest[:] = f32(np.inf)
        for x in range(width):
            z = depth[y, x]
            if z > f32(0):
                cell = width + np.int64(np.floor(x - disparity_at_1m / z))
                if cell >= 0:  # what lies farther left is outside the other view
                    nearest[cell] = min(nearest[cell], z)
                    nearest[cell + 1] = min(nearest[cell + 1], z)
        for x in range(width):
            z = depth[y, x]
            if z > f32(0):
                cell = width + np.int64(np.floor(x - disparity_at_1m / z + 0.5))
                if cell >= 0 and nearest[cell] < z * (f32(1) - tolerance):
                    lost[y, x] = True


@njit(cache=True, nogil=True, error_model="numpy")
def measure_colour(rgb, key, quantiles, sigma_of_grey, out):
    """Colour with Gaussian noise; 13 of the pixel's 64 random bits for each channel."""
    height, width = rgb.shape[:2]
    for y in range(height):
        for x in range(width):
            bits = _mixed(key + u64(y * width + x) * u64(0x9E3779B97F4A7C15))
            for channel in range(3):
                grey = rgb[y, x, channel]
                noise = quantiles[(bits >> u64(13 * channel)) & u64(QUANTILES - 1)] * sigma_of_grey[grey]
                level = np.int64(np.floor(f32(grey) + noise + f32(0.5)))
                out[y, x, channel] = min(max(level, 0), 255)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_depth(
    depth,
    normals,
    lost,
    key,
    lens,
    quantiles,
    offsets,
    slant_table,
    sigma,
    slant_sigma,
    edge_jump,
    hole_cosines,
    disparity_scale,
    limits,
    steps_per_metre,
    out,
):
    """Depth with all its errors; 9 of the pixel's 64 random bits for each lateral axis, 13 for the axial noise.

    Args:
        depth: (H, W) perfect depth.
        lost: (H, W) what gives no depth whatever its angle.
        normals: (H, W, 3), or (0, 0, 3) where nothing depends on the angle.
        key: of the frame.
        lens: fx, fy, cx, cy.
        quantiles: (8192,) of the standard normal distribution.
        offsets: (512,) quantiles of the lateral noise in whole pixels.
        slant_table: growth of the axial noise by the cosine of the angle of incidence, 0 to 1.
        sigma: floor (m), growth (1/m), origin (m) of the axial noise.
        slant_sigma: factor on `slant_table` (m at 1 m).
        edge_jump: neighbours that differ by less than this share belong to one surface: no lateral noise.
        hole_cosines: cosines where holes begin and where nothing is left.
        disparity_scale: focal length times baseline over the disparity step, 0 = no such rounding.
        limits: nearest and farthest depth.
        steps_per_metre: of the result, 0 = no rounding.
        out: (H, W) result.
    """
    height, width = depth.shape
    sigma_floor, sigma_growth, sigma_origin = sigma
    fx, fy, cx, cy = lens
    hole_first, hole_last = hole_cosines
    angles = len(normals) > 0
    hole_key = _mixed(key ^ u64(0xD1B54A32D192ED03))
    for y in range(height):
        ray_y = f32((y - cy) / fy)
        for x in range(width):
            out[y, x] = f32(0)
            bits = _mixed(key + u64(y * width + x) * u64(0x9E3779B97F4A7C15))
            source_x = min(max(x + offsets[bits & u64(511)], 0), width - 1)
            source_y = min(max(y + offsets[(bits >> u64(9)) & u64(511)], 0), height - 1)
            z, own = depth[source_y, source_x], depth[y, x]
            if z <= f32(0) or lost[source_y, source_x]:
                continue
            at_x, at_y = source_x, source_y
            if abs(z - own) <= edge_jump * own:
                z, at_x, at_y = own, x, y
            away = z - sigma_origin
            spread = sigma_floor + sigma_growth * away * away
            if angles:
                ray_x = f32((x - cx) / fx)
                length = np.sqrt(ray_x * ray_x + ray_y * ray_y + f32(1))
                facing = normals[at_y, at_x, 0] * ray_x + normals[at_y, at_x, 1] * ray_y + normals[at_y, at_x, 2]
                cosine = min(max(-facing / length, f32(0)), f32(1))
                if cosine < hole_first:
                    block = (source_y // HOLE_PX) * width + source_x // HOLE_PX
                    chance = _mixed(hole_key + u64(block) * u64(0x9E3779B97F4A7C15)) >> u64(48)
                    share = (hole_first - cosine) / (hole_first - hole_last)
                    if f32(chance) < share * f32(65536):
                        continue
                entry = min(np.int64(cosine * f32(len(slant_table))), len(slant_table) - 1)
                spread += slant_sigma * slant_table[entry] / np.sqrt(z)
            z += quantiles[bits >> u64(51)] * spread
            if disparity_scale > f32(0):
                z = disparity_scale / np.floor(max(disparity_scale / z + f32(0.5), f32(1)))
            if not limits[0] <= z <= limits[1]:
                continue
            if steps_per_metre > 0.0:
                z = f32(np.floor(np.float64(z) * steps_per_metre + 0.5) / steps_per_metre)
            out[y, x] = z
