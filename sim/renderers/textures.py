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
        levels: list[npt.NDArray[np.uint32]] = []
        offsets, sizes, total = [], [], 0
        for image in images:
            offsets.append(total)
            sizes.append(image.shape[0])
            level = image.astype(np.int32)
            while True:
                levels.append(_tiled(level[..., 0] | level[..., 1] << 8 | level[..., 2] << 16))
                total += levels[-1].size
                if len(level) == 1:
                    break
                rows = level[::2] + level[1::2]
                level = (rows[:, ::2] + rows[:, 1::2] + 2) >> 2
        return cls(
            texels=np.concatenate(levels) if levels else np.zeros(0, np.uint32),
            offsets=np.array(offsets, np.int32),
            sizes=np.array(sizes, np.int32),
        )


def _tiled(level: npt.NDArray[np.int32]) -> npt.NDArray[np.uint32]:
    """Texels (S, S) in the order of `TextureAtlas.texels`."""
    if len(level) >= 4:
        tiles = len(level) // 4
        level = level.reshape(tiles, 2, 2, tiles, 2, 2).transpose(0, 3, 1, 4, 2, 5)
    return level.astype(np.uint32).ravel()
