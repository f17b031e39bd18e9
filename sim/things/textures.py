"""Procedural images for the things in the world: uint8 RGB, square, a power of two, first row at the top.

Every function takes the generator of its consumer (`sim.randomness.child`). The path from random numbers to bytes
uses only elementwise IEEE operations, integers and OpenCV's integer drawing, no sine and no resampling by a library,
so the bytes do not depend on the machine. No image repeats itself within: a repeating pattern makes a visual SLAM
system see places again where it has never been.
"""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float32]
Colour = tuple[int, int, int]


def noise(
    rng: np.random.Generator,
    shape: tuple[int, int],
    cells: float,
    *,
    octaves: int = 5,
    persistence: float = 0.55,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> Field:
    """Fractal value noise of about zero mean and unit variance.

    Args:
        rng: generator.
        shape: rows and columns.
        cells: cells of the coarsest octave along the columns; each further octave doubles them.
        octaves: number of octaves.
        persistence: amplitude of an octave in terms of the coarser one.
        stretch: factor on the cells along rows and columns.
    """
    total = np.zeros(shape, np.float32)
    power, amplitude = 0.0, 1.0
    for octave in range(octaves):
        counts = [min(shape[k], max(1, round(cells * 2**octave * stretch[k] * shape[k] / shape[1]))) for k in range(2)]
        grid = rng.random((counts[0] + 2, counts[1] + 2), dtype=np.float32) - np.float32(0.5)
        total += np.float32(amplitude) * _spread(grid, shape, counts)
        power += amplitude**2 * 0.0833 * 0.55  # variance of a uniform number, times what interpolation leaves
        amplitude *= persistence
    return total * np.float32(power**-0.5)


def _spread(grid: Field, shape: tuple[int, int], counts: list[int]) -> Field:
    """`grid` interpolated to `shape`, smooth at its nodes."""
    for axis in (1, 0):  # columns first: the grid still has few rows, and whole rows are quick to gather
        position = (np.arange(shape[axis]) + 0.5) * (counts[axis] / shape[axis])
        index = position.astype(np.intp)
        part = position - index
        weight = (part * part * (3 - 2 * part)).astype(np.float32)
        weight = weight[:, None] if axis == 0 else weight[None, :]
        low = np.take(grid, index, axis=axis)
        grid = np.take(grid, index + 1, axis=axis)
        grid -= low
        grid *= weight
        grid += low
    return grid


def tinted(colour: tuple[float, float, float], brightness: Field) -> Image:
    """`colour` times `brightness` per pixel, in steps of 1/128."""
    levels = np.arange(256)[:, None] / 128 * np.asarray(colour)
    table = np.minimum(levels, 255).astype(np.uint8)
    index = np.minimum(np.maximum(brightness * np.float32(128), np.float32(0)), np.float32(255)).astype(np.uint8)
    return np.asarray(np.take(table, index, axis=0))


def plain(rng: np.random.Generator, colour: Colour, size: int = 64, contrast: float = 0.03) -> Image:
    """One colour with slight mottling: plastic, metal, painted board."""
    return tinted(colour, 1 + np.float32(contrast) * noise(rng, (size, size), 6))


def carpet(rng: np.random.Generator, size: int, colour: Colour = (104, 106, 116)) -> Image:
    """Loop carpet with flecks of other colours and worn and stained places, meant to span a floor once."""
    shape = (size, size)
    tufts = noise(rng, shape, size / 2.6, octaves=1)
    wear = noise(rng, (size // 2, size // 2), 5, octaves=5, persistence=0.75).repeat(2, axis=0).repeat(2, axis=1)
    image = tinted(colour, 1 + np.float32(0.11) * tufts + np.float32(0.09) * wear)
    count = size * size // 500
    places = rng.integers(2, size - 2, (count, 2))
    colours = rng.integers(40, 215, (count, 3))
    sizes = rng.integers(1, 4, count)
    for (u, v), fleck, extent in zip(places.tolist(), colours.tolist(), sizes.tolist(), strict=True):
        image[v : v + extent, u : u + extent] = fleck
    for _ in range(size // 40):
        extent = size // 24
        u, v = (int(x) for x in rng.integers(0, size - extent, 2))
        axes = tuple(int(x) for x in rng.integers(extent // 10 + 1, extent // 2, 2))
        stain = np.zeros((extent, extent), np.uint8)
        cv2.ellipse(stain, (extent // 2, extent // 2), axes, int(rng.integers(0, 180)), 0, 360, 1, -1)
        part = image[v : v + extent, u : u + extent]
        part[stain > 0] = part[stain > 0] * np.float32(rng.uniform(0.72, 0.9))
    return image


def wood(
    rng: np.random.Generator, size: int = 512, light: Colour = (186, 140, 92), dark: Colour = (122, 80, 46)
) -> Image:
    """Planed wood; the grain runs along the columns."""
    shape = (size, size)
    warp = noise(rng, shape, 1.5, stretch=(3, 1))
    rows = np.linspace(0, 11, size, dtype=np.float32)[:, None]
    phase = rows + np.float32(0.45) * warp
    saw = phase - np.floor(phase)
    rings = 4 * saw * (1 - saw)
    fibre = noise(rng, shape, 6, octaves=4, stretch=(24, 1))
    t = np.clip(np.float32(0.6) * rings * rings + np.float32(0.14) * fibre + np.float32(0.15), 0, 1)
    image = np.empty((*shape, 3), np.uint8)
    for k in range(3):
        image[..., k] = light[k] + (dark[k] - light[k]) * t
    for _ in range(int(rng.integers(3, 7))):
        knot = tuple(int(v) for v in rng.integers(0, size, 2))
        radius = int(rng.integers(size // 120 + 1, size // 60 + 2))
        cv2.ellipse(image, knot, (2 * radius, radius), 0, 0, 360, tuple(int(0.62 * c) for c in dark), -1, cv2.LINE_AA)
    for _ in range(size // 20):
        start = rng.integers(0, size, 2)
        end = start + rng.integers(-size // 12, size // 12 + 1, 2)
        shade = float(rng.uniform(0.8, 1.15))
        colour = tuple(min(255, int(shade * c)) for c in light)
        cv2.line(image, tuple(start.tolist()), tuple(end.tolist()), colour, 1, cv2.LINE_AA)
    return image


def plaster(rng: np.random.Generator, shape: tuple[int, int], colour: Colour = (214, 209, 196)) -> Image:
    """A painted wall of `shape` (rows, columns), not square: mottling, scuffs, hairline cracks, nail holes."""
    fine = noise(rng, shape, shape[1] / 10, octaves=3)
    coarse = noise(rng, shape, 5, octaves=5)
    image = tinted(colour, 1 + np.float32(0.022) * fine + np.float32(0.03) * coarse)
    rows, columns = shape
    for _ in range(columns // 20):
        start = rng.integers(0, (columns, rows))
        end = start + rng.integers(-columns // 30, columns // 30 + 1, 2)
        shade = float(rng.uniform(0.86, 0.98))
        cv2.line(
            image, tuple(start.tolist()), tuple(end.tolist()), tuple(int(shade * c) for c in colour), 1, cv2.LINE_AA
        )
    for _ in range(columns // 8):
        u, v = int(rng.integers(0, columns)), int(rng.integers(0, rows))
        dark = int(rng.integers(60, 160))
        extent = int(rng.integers(1, 2 + columns // 700))
        image[v : v + extent, u : u + extent] = dark
    for _ in range(4):
        crack = np.cumsum(rng.integers(-9, 10, (40, 2)) + np.array([0, 6]), axis=0) + rng.integers(
            0, (columns, rows // 2)
        )
        cv2.polylines(image, [crack.astype(np.int32)], False, tuple(int(0.72 * c) for c in colour), 1, cv2.LINE_AA)
    return image


def brick(rng: np.random.Generator, shape: tuple[int, int], metres: tuple[float, float]) -> Image:
    """A wall of `shape` (rows, columns) and `metres` (height, width) of bricks of irregular widths and heights."""
    rows, columns = shape
    per_m_v, per_m_u = rows / metres[0], columns / metres[1]
    image = tinted((172, 166, 156), 1 + np.float32(0.05) * noise(rng, shape, columns / 6, octaves=2))
    v = 0.0
    while v < rows:
        height = per_m_v * rng.uniform(0.06, 0.1)
        u = -per_m_u * rng.uniform(0.0, 0.3)
        while u < columns:
            width = per_m_u * rng.uniform(0.12, 0.34)
            red = np.array([164.0, 88.0, 66.0]) * rng.uniform(0.68, 1.22) + rng.uniform(-14, 14, 3)
            gap = 0.005 * per_m_u
            corner = (int(u + gap), int(v + 0.005 * per_m_v))
            opposite = (int(u + width - gap), int(v + height - 0.005 * per_m_v))
            cv2.rectangle(image, corner, opposite, tuple(int(c) for c in red), -1)
            u += width
        v += height
    grain = 1 + np.float32(0.08) * noise(rng, shape, columns / 24, octaves=4)
    return np.clip(image * grain[..., None], 0, 255).astype(np.uint8)


def ceiling(rng: np.random.Generator, size: int) -> Image:
    """Acoustic boards of irregular widths with random pores."""
    image = tinted((222, 222, 216), 1 + np.float32(0.012) * noise(rng, (size, size), 6))
    for u, v in rng.integers(0, size, (size * size // 60, 2)).tolist():
        image[v, u] = 168
    v = 0
    while v < size:
        height, u = int(size * rng.uniform(0.07, 0.15)), -int(size * rng.uniform(0.0, 0.2))
        while u < size:
            width = int(size * rng.uniform(0.12, 0.3))
            cv2.rectangle(image, (u, v), (u + width, v + height), (150, 150, 146), 1)
            u += width
        v += height
    return image


def cloth(rng: np.random.Generator, colour: Colour, size: int = 256) -> Image:
    """Coarse upholstery with differently dyed threads."""
    warp = noise(rng, (size, size), size / 2, octaves=1, stretch=(0.25, 1))
    weft = noise(rng, (size, size), size / 2, octaves=1, stretch=(1, 0.25))
    wear = noise(rng, (size, size), 3, octaves=3)
    image = tinted(colour, 1 + np.float32(0.1) * (warp + weft) + np.float32(0.05) * wear)
    light = tuple(min(255, 70 + c) for c in colour)
    for u, v in rng.integers(0, size - 2, (size * size // 220, 2)).tolist():
        image[v : v + 2, u : u + 2] = light
    return image


def leaf(rng: np.random.Generator, size: int = 128) -> Image:
    """Green with a mid rib and veins along the rows."""
    image = tinted((62, 118, 52), 1 + np.float32(0.2) * noise(rng, (size, size), 5))
    cv2.line(image, (size // 2, 0), (size // 2, size), (140, 176, 98), max(2, size // 40), cv2.LINE_AA)
    for v in range(size // 12, size, size // 9):
        rise = size // 7 + int(rng.integers(0, size // 16))
        for end in (0, size):
            cv2.line(image, (size // 2, v + rise), (end, v), (98, 148, 78), 1, cv2.LINE_AA)
    return image
