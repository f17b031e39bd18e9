"""Shading: the second half of the renderer's inner loops. Compiled by numba, under the rules of `kernels`.

With the notation of `kernels`: z is known from the visibility buffer, so Bi = z (r . ei) / det are the true barycentric
coordinates of a pixel's point, and an attribute is their weighted sum. The surface area that one pixel sees is
dA = z^3 / d / (fx fy), with d = |det| / (2 A) the distance of the triangle's plane from the camera. So the texels per
pixel (an area, slant included) are size^2 |uv cross product| z^3 / (|det| fx fy).
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

from sim.renderers.kernels import KERNEL, cross
from sim.renderers.texture_kernels import (
    AREA,
    BLOCK,
    COLOUR,
    GREEN,
    INTEGER_ROWS,
    ORIGIN,
    RED_BLUE,
    SIDE,
    U,
    V,
    look_up,
)

f32 = np.float32

SHADOW_NEAR = f32(0.05)
SHADOW_TANGENT = 2.75
"""A shadow camera looks straight down and sees this far sideways per metre of depth; beyond, all is lit."""
SHADOW_DEPTH_BIAS = f32(0.01)
SHADOW_OFFSET_TEXELS = f32(2.2)
"""Points are moved along their normal by this many shadow texels before the test, against self-shadowing."""

BRIGHTNESS_KNEE = f32(0.7)
"""Brightness above it is compressed and stays below 1: no channel burns out."""


@njit(**KERNEL)
def lit(inverse_z, limit):
    """1 where the nearest surface seen by the light is not in front of the point."""
    return f32(1) if inverse_z <= limit else f32(0)


@njit(**KERNEL)
def shade(
    camera,
    attributes,
    faces,
    face_texture,
    face_id,
    texels,
    texture_offset,
    texture_size,
    fx,
    fy,
    cx,
    cy,
    T_world_camera,
    row_first,
    row_last,
    inverse_depth,
    triangles,
    lights,
    ambient,
    shadow_maps,
    colour,
    depth,
    ids,
):
    """Colour, z-depth and id of the rows row_first..row_last-1, from the visibility buffer.

    Per block of pixels: interpolate the attributes, add up the light, look up the texture. Light varies slowly, so two
    neighbours on one triangle share a lane of the lighting. `colour` (H, W) is 0x00bbggrr.
    """
    one, half, zero = f32(1), f32(0.5), f32(0)
    u1, u3 = np.uint64(1), np.uint64(3)
    flat_t, flat_w = triangles.ravel(), inverse_depth.ravel()
    flat_colour, flat_depth, flat_ids = colour.ravel(), depth.ravel(), ids.ravel()
    width = triangles.shape[1]
    inverse_fx, inverse_fy = 1.0 / fx, 1.0 / fy
    inverse_focals = inverse_fx * inverse_fy
    T = T_world_camera
    shadow_size = shadow_maps.shape[1]
    shadows = shadow_maps.ravel()
    stride = np.uint64(shadow_size)
    shadow_high = f32(shadow_size - 2)
    shadow_centre = f32(shadow_size - 1) * half
    shadow_focal = f32(shadow_size * 0.5 / SHADOW_TANGENT)
    offset_per_metre = SHADOW_OFFSET_TEXELS / shadow_focal if shadow_size > 0 else zero
    # Rows of the real scratch, by pixel: those of `look_up`; by lane: 3-5 normal, 6 ray x, 7 z, 8-10 position,
    # 11 brightness, 12 one light's share, 13-14 shadow texel, 15 limit of 1/z in the shadow map.
    s = np.zeros(16 * BLOCK, np.float32)
    integer = np.zeros(INTEGER_ROWS * BLOCK, np.int32)
    natural = integer.view(np.uint32)
    lane_of, factors = np.zeros(BLOCK, np.int64), np.zeros(BLOCK, np.uint32)
    rays_x = np.zeros(width, np.float32)
    for x in range(width):
        rays_x[x] = (x - cx) * inverse_fx
    for y in range(row_first, row_last):
        row_start = np.uint64(y * width)
        ray_y = (y - cy) * inverse_fy
        ray_y32 = f32(ray_y)
        row_x = T[0, 1] * ray_y32 + T[0, 2]
        row_y = T[1, 1] * ray_y32 + T[1, 2]
        row_z = T[2, 1] * ray_y32 + T[2, 2]
        for x_first in range(0, width, BLOCK):
            count = min(BLOCK, width - x_first)
            previous, lanes, is_open = -1, 0, False
            integer[SIDE : SIDE + BLOCK] = 0
            i = j = k = np.uint32(0)
            q1x = q1 = q2x = q2 = density = u_a = u_b = u_g = v_a = v_b = v_g = zero
            side = origin = np.int32(0)
            for n in range(count):
                pixel = row_start + np.uint64(x_first + n)
                t = flat_t[pixel]
                if t < 0:
                    flat_depth[pixel] = 0
                    flat_ids[pixel] = 0
                    continue
                z = one / flat_w[pixel]
                flat_depth[pixel] = z
                if t != previous:  # neighbours mostly share the triangle: keep its constants
                    previous, is_open = t, False
                    face = np.uint32(t)
                    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
                    ax, ay, az = np.float64(camera[i, 0]), np.float64(camera[i, 1]), np.float64(camera[i, 2])
                    bx, by, bz = np.float64(camera[j, 0]), np.float64(camera[j, 1]), np.float64(camera[j, 2])
                    gx, gy, gz = np.float64(camera[k, 0]), np.float64(camera[k, 1]), np.float64(camera[k, 2])
                    e1x, e1y, e1z = cross(gx, gy, gz, ax, ay, az)
                    e2x, e2y, e2z = cross(ax, ay, az, bx, by, bz)
                    inverse_det = 1.0 / (bx * e1x + by * e1y + bz * e1z)
                    q1x, q2x = f32(e1x * inverse_det), f32(e2x * inverse_det)
                    q1, q2 = f32((e1y * ray_y + e1z) * inverse_det), f32((e2y * ray_y + e2z) * inverse_det)
                    texture = np.uint32(face_texture[face])
                    side, origin = texture_size[texture], texture_offset[texture]
                    size = np.float64(side)
                    u_a, u_b, u_g = attributes[i, 6], attributes[j, 6], attributes[k, 6]
                    v_a, v_b, v_g = attributes[i, 7], attributes[j, 7], attributes[k, 7]
                    uv_area = abs((u_b - u_a) * (v_g - v_a) - (v_b - v_a) * (u_g - u_a))
                    density = f32(size * size * uv_area * abs(inverse_det) * inverse_focals)
                    identity = face_id[face]
                flat_ids[pixel] = identity
                ray_x = rays_x[x_first + n]
                # Rounding must not leave the triangle: the thinner it is, the farther it would lead.
                b1 = min(max((q1x * ray_x + q1) * z, zero), one)
                b2 = min(max((q2x * ray_x + q2) * z, zero), one - b1)
                b0 = one - b1 - b2
                s[U + n], s[V + n] = u_a * b0 + u_b * b1 + u_g * b2, v_a * b0 + v_b * b1 + v_g * b2
                s[AREA + n] = density * z * z * z
                integer[SIDE + n], integer[ORIGIN + n] = side, origin
                if is_open:
                    is_open = False
                else:
                    is_open = True
                    for c in range(3, 6):
                        s[c * BLOCK + lanes] = attributes[i, c] * b0 + attributes[j, c] * b1 + attributes[k, c] * b2
                    s[6 * BLOCK + lanes] = ray_x
                    s[7 * BLOCK + lanes] = z
                    lanes += 1
                lane_of[n] = lanes - 1
            groups = (lanes + 7) >> 3  # of 8 lanes: the inner loops below become single vector instructions

            # Position, unit normal; ambient light from above is stronger than from below: unlit sides keep shape.
            for g in range(groups):
                for n in range(8 * g, 8 * g + 8):
                    ray_x, z = s[6 * BLOCK + n], s[7 * BLOCK + n]
                    s[8 * BLOCK + n] = (T[0, 0] * ray_x + row_x) * z + T[0, 3]
                    s[9 * BLOCK + n] = (T[1, 0] * ray_x + row_y) * z + T[1, 3]
                    s[10 * BLOCK + n] = (T[2, 0] * ray_x + row_z) * z + T[2, 3]
                    nx, ny, nz = s[3 * BLOCK + n], s[4 * BLOCK + n], s[5 * BLOCK + n]
                    scale = one / np.sqrt(nx * nx + ny * ny + nz * nz + f32(1e-20))
                    s[3 * BLOCK + n], s[4 * BLOCK + n], s[5 * BLOCK + n] = nx * scale, ny * scale, nz * scale
                    s[11 * BLOCK + n] = ambient * (one + f32(0.25) * (nz * scale))

            for m in range(lights.shape[0]):
                light_x, light_y, light_z, power = lights[m, 0], lights[m, 1], lights[m, 2], lights[m, 3]
                for g in range(groups):
                    for n in range(8 * g, 8 * g + 8):
                        lx = light_x - s[8 * BLOCK + n]
                        ly = light_y - s[9 * BLOCK + n]
                        lz = light_z - s[10 * BLOCK + n]
                        nx, ny, nz = s[3 * BLOCK + n], s[4 * BLOCK + n], s[5 * BLOCK + n]
                        squared = lx * lx + ly * ly + lz * lz
                        facing = lx * nx + ly * ny + lz * nz
                        facing = facing if facing > zero else zero
                        s[12 * BLOCK + n] = facing * power / (np.sqrt(squared + f32(1e-12)) * (one + squared))
                        # The shadow camera looks straight down: its axes are +x, -y, -z of the world.
                        offset = lz * offset_per_metre
                        offset = offset if offset > f32(0.005) else f32(0.005)
                        shadow_z = lz - nz * offset
                        shadow_z = shadow_z if shadow_z > SHADOW_NEAR else SHADOW_NEAR
                        scale = shadow_focal / shadow_z
                        s[13 * BLOCK + n] = (nx * offset - lx) * scale + shadow_centre
                        s[14 * BLOCK + n] = (ly - ny * offset) * scale + shadow_centre
                        s[15 * BLOCK + n] = one / (shadow_z - SHADOW_DEPTH_BIAS)
                map_first = m * shadow_size * shadow_size
                for n in range(lanes):
                    share = s[12 * BLOCK + n]
                    if share <= zero:
                        continue
                    sx, sy, limit = s[13 * BLOCK + n], s[14 * BLOCK + n], s[15 * BLOCK + n]
                    if one <= sx < shadow_high and one <= sy < shadow_high:
                        # Mean of 3x3 bilinear depth tests (percentage closer filtering; Reeves, Salesin, Cook 1987):
                        # 4x4 tests with the weights (1 - f, 1, 1, f) / 3 along each axis. Where the four corners and
                        # the centre agree, so do the rest.
                        column, row = np.int64(sx), np.int64(sy)
                        fu, fv = sx - f32(column), sy - f32(row)
                        line = np.uint64(map_first + (row - 1) * shadow_size + column - 1)
                        low = line + u3 * stride
                        total = lit(shadows[line], limit) + lit(shadows[line + u3], limit)
                        total += lit(shadows[low], limit) + lit(shadows[low + u3], limit)
                        total += lit(shadows[line + stride + u1], limit)
                        if total == zero:
                            continue
                        if total < f32(5):
                            total = zero
                            for r in range(4):
                                part = lit(shadows[line], limit) * (one - fu) + lit(shadows[line + u1], limit)
                                part += lit(shadows[line + u1 + u1], limit) + lit(shadows[line + u3], limit) * fu
                                total += part * (one - fv if r == 0 else (fv if r == 3 else one))
                                line += stride
                            share *= total * f32(1.0 / 9.0)
                    s[11 * BLOCK + n] += share

            for g in range(groups):
                for n in range(8 * g, 8 * g + 8):
                    brightness = s[11 * BLOCK + n]
                    over = brightness - BRIGHTNESS_KNEE
                    over = over if over > zero else zero
                    room = one - BRIGHTNESS_KNEE
                    brightness = brightness if brightness < BRIGHTNESS_KNEE else BRIGHTNESS_KNEE
                    s[11 * BLOCK + n] = (brightness + room * over / (over + room)) * f32(256)

            look_up(texels, s, integer)
            for n in range(BLOCK):
                factors[n] = np.uint32(s[11 * BLOCK + lane_of[n]]) if integer[SIDE + n] > 0 else np.uint32(0)
            for n in range(count):
                texel, factor = natural[COLOUR + n], factors[n]
                red_blue = (np.uint32((texel & RED_BLUE) * factor) >> np.uint32(8)) & RED_BLUE
                green = (((texel & GREEN) >> np.uint32(8)) * factor) & GREEN
                flat_colour[row_start + np.uint64(x_first + n)] = red_blue | green
