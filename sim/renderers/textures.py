"""Textures as the shading kernel reads them: all mip levels of all textures in one array."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TextureAtlas:
    """Packed textures.

    Attributes:
        texels: (n,) uint32, 0x00bbggrr; the levels of a texture follow each other, from full size down to 1 x 1. Each
            is a row-major order of tiles of 4 x 4 texels, one line of the processor's cache; so are the 2 x 2 quarters
            of a tile, and the texels of a quarter.
        offsets: (T,) int32, index of each texture's first texel.
        sizes: (T,) int32, side of each texture's full level.
    """

    texels: npt.NDArray[np.uint32]
    offsets: npt.NDArray[np.int32]
    sizes: npt.NDArray[np.int32]

    @classmethod
    def of(cls, images: Iterable[npt.NDArray[np.uint8]]) -> "TextureAtlas":
        """Pack square uint8 RGB images (S, S, 3), S a power of two. Each mip level is the 2x2 mean of the last."""
        images = list(images)
        sizes = np.array([len(image) for image in images], np.int32)
        lengths = [(4 * size * size - 1) // 3 for size in sizes.tolist()]  # of all levels
        offsets = np.cumsum([0, *lengths])
        texels = np.empty(offsets[-1], np.uint32)
        for image, offset in zip(images, offsets.tolist(), strict=False):
            # Two channels in one number, with room for the sum of four.
            red_blue = image[..., 0] | image[..., 2].astype(np.uint32) << np.uint32(16)
            green = image[..., 1].astype(np.uint32)
            first = offset
            while True:
                last = first + green.size
                _put_tiles(red_blue | green << np.uint32(8), texels[first:last])
                if len(green) == 1:
                    break
                first = last
                red_blue, green = _halved(red_blue) & np.uint32(0x00FF00FF), _halved(green) & np.uint32(0xFF)
        return cls(texels=texels, offsets=offsets[:-1].astype(np.int32), sizes=sizes)


def _halved(level: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """The rounded means of 2x2 texels (S / 2, S / 2); in each upper half bits are left over from the next."""
    rows = level[::2] + level[1::2]
    return (rows[:, ::2] + rows[:, 1::2] + np.uint32(0x00020002)) >> np.uint32(2)


def _put_tiles(level: npt.NDArray[np.uint32], texels: npt.NDArray[np.uint32]) -> None:
    """Texels (S, S) in the order of `TextureAtlas.texels`."""
    if len(level) < 4:
        texels[:] = level.ravel()
        return
    tiles = len(level) // 4
    ordered = level.reshape(tiles, 2, 2, tiles, 2, 2).transpose(0, 3, 1, 4, 2, 5)
    texels.reshape(ordered.shape)[:] = ordered
