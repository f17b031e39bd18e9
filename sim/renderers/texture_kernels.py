"""Texture filtering of a block of pixels. Compiled by numba, under the rules of `kernels`.

All is done in loops over the whole block, which LLVM turns into vector instructions; only the texels themselves are
fetched one by one. A texel 0x00bbggrr is filtered as two numbers, red with blue and green alone, so that each channel
has 16 bits of room.
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

from sim.renderers.kernels import KERNEL

f32, i32, u32 = np.float32, np.int32, np.uint32

BLOCK = 64
"""Pixels shaded together. Rows of a block's scratch have a constant distance, so LLVM can prove that they do not
overlap and vectorise the loops over them."""

AREA_MAX = f32(2.0**40)
"""Texels per pixel beyond every texture."""

U, V, AREA = 0, BLOCK, 2 * BLOCK
"""Rows of the real scratch that `look_up` reads: texture coordinates, texels per pixel."""
SIDE, ORIGIN, COLOUR = 0, BLOCK, 2 * BLOCK
"""Rows of the integer scratch that `look_up` reads: side of the full texture (0 = no texel is wanted), where it begins
in the atlas; and the one it fills: colours 0x00bbggrr."""
_LEVEL, _SIZE, _BLEND, _U, _V, _WEIGHT_U, _WEIGHT_V, _00, _01, _10, _11 = (BLOCK * row for row in range(3, 14))
INTEGER_ROWS = 14

RED_BLUE, GREEN = u32(0x00FF00FF), u32(0x0000FF00)
"""Bits of a texel. Both halves have room for a product with 256."""


@njit(**KERNEL)
def across(u):
    """What a texel's column adds to its place in the tiles of `TextureAtlas`."""
    return ((u & ~3) << 2) + ((u & 2) << 1) + (u & 1)


@njit(**KERNEL)
def along(v, size):
    """What its row adds."""
    return (v & ~3) * size + ((v & 2) << 2) + ((v & 1) << 1)


@njit(**KERNEL)
def weighted(a, b, c, d, weight_a, weight_b, weight_c, weight_d):
    """Sum of four texels times their weights; of the weights' sum, 256, no channel reaches into the next."""
    return u32(a * weight_a + b * weight_b + c * weight_c + d * weight_d)


@njit(**KERNEL)
def look_up(texels, real, integer):
    """Trilinear: the mean of the four nearest texels in each of two mip levels, blended by the texels per pixel.

    Overwrites every row but the texture coordinates and `SIDE`.

    Args:
        texels: of the atlas.
        real: (>= 3 BLOCK,) float32 scratch.
        integer: (INTEGER_ROWS BLOCK,) int32 scratch.
    """
    one = f32(1)
    bits, natural = real.view(i32), integer.view(u32)
    # The level is the exponent of 4 in the texels per pixel; the square root of the rest is how far it is to the next.
    for n in range(BLOCK):
        area = real[AREA + n]
        area = area if area > one else one
        real[AREA + n] = area if area < AREA_MAX else AREA_MAX
    for n in range(BLOCK):
        level = (bits[AREA + n] - i32(127 << 23)) >> 24
        bits[AREA + n] -= level << 24
        integer[_LEVEL + n] = level
    for n in range(BLOCK):
        full = integer[SIDE + n]
        size = full >> integer[_LEVEL + n]
        blend = i32((np.sqrt(real[AREA + n]) - one) * f32(256))
        integer[_BLEND + n] = blend if size > 1 else 0
        size = i32(size if size > 1 else 1)
        integer[_SIZE + n] = size
        # The finer levels hold (full^2 - size^2) 4/3 texels. A third of a difference of powers of 4 are its bits at the
        # even places.
        integer[ORIGIN + n] += ((full * full - size * size) & 0x55555555) << 2
        # Coordinates in 1/256 texel. Texel centres lie at the half integers.
        wide = i32(size << 8)
        u, v = real[U + n], real[V + n]
        integer[_U + n] = i32((u - np.floor(u)) * f32(wide)) + wide
        integer[_V + n] = i32((v - np.floor(v)) * f32(wide)) + wide
    for coarser in range(2):
        for n in range(BLOCK):
            full = integer[_SIZE + n]
            size = full >> coarser
            level = integer[ORIGIN + n] + coarser * full * full
            u, v = i32((integer[_U + n] >> coarser) - 128), i32((integer[_V + n] >> coarser) - 128)
            wrap = size - 1  # size is a power of two: & repeats the texture
            u0, v0 = (u >> 8) & wrap, (v >> 8) & wrap
            u1, v1 = (u0 + 1) & wrap, (v0 + 1) & wrap
            left, right = across(u0), across(u1)
            top, bottom = level + along(v0, size), level + along(v1, size)
            integer[_00 + n], integer[_01 + n] = top + left, top + right
            integer[_10 + n], integer[_11 + n] = bottom + left, bottom + right
            integer[_WEIGHT_U + n], integer[_WEIGHT_V + n] = u & 255, v & 255
        for n in range(BLOCK):
            if integer[SIDE + n] > 0 and (coarser == 0 or integer[_BLEND + n] > 0):
                natural[_00 + n] = texels[natural[_00 + n]]
                natural[_01 + n] = texels[natural[_01 + n]]
                natural[_10 + n] = texels[natural[_10 + n]]
                natural[_11 + n] = texels[natural[_11 + n]]
        for n in range(BLOCK):
            weight_u, weight_v = natural[_WEIGHT_U + n], natural[_WEIGHT_V + n]
            w11 = u32(weight_u * weight_v) >> u32(8)
            w00, w01, w10 = 256 - weight_u - weight_v + w11, weight_u - w11, weight_v - w11
            t00, t01, t10, t11 = natural[_00 + n], natural[_01 + n], natural[_10 + n], natural[_11 + n]
            red_blue = weighted(t00 & RED_BLUE, t01 & RED_BLUE, t10 & RED_BLUE, t11 & RED_BLUE, w00, w01, w10, w11)
            green = weighted(t00 & GREEN, t01 & GREEN, t10 & GREEN, t11 & GREEN, w00, w01, w10, w11)
            red_blue, green = (red_blue >> u32(8)) & RED_BLUE, (green >> u32(8)) & GREEN
            if coarser == 0:
                natural[COLOUR + n] = red_blue | green
            else:
                fine, share = natural[COLOUR + n], natural[_BLEND + n]
                red_blue = u32(red_blue * share + (fine & RED_BLUE) * (256 - share))
                green = u32(green * share + (fine & GREEN) * (256 - share))
                natural[COLOUR + n] = ((red_blue >> u32(8)) & RED_BLUE) | ((green >> u32(8)) & GREEN)
