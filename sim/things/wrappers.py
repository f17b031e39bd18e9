"""Glazes, labels and card as images: what cups, bottles and boxes wear.

The same rules as in `sim.things.textures`: by generator, square, a power of two, first row at the top, and bytes that
do not depend on the machine.
"""

import cv2
import numpy as np

from sim.things.prints import WORDS, picture, write_text
from sim.things.textures import Colour, Image, noise, plain, tinted

CARD: Colour = (186, 146, 100)
"""Brown corrugated card."""


def card(rng: np.random.Generator, size: int = 256, *, shade: float = 1.0) -> Image:
    """Corrugated card: faint ribs along the columns, flecks."""
    ribs = noise(rng, (size, size), size / 5, octaves=1, stretch=(0.02, 1))
    flecks = noise(rng, (size, size), size / 3, octaves=2)
    wear = noise(rng, (size, size), 3, octaves=3)
    brightness = 1 + np.float32(0.025) * ribs + np.float32(0.03) * flecks + np.float32(0.03) * wear
    return tinted(CARD, np.float32(shade) * brightness)


def carton_side(rng: np.random.Generator, *, is_printed: bool, size: int = 256) -> Image:
    """The side of a box; printed: a name, arrows that point up, and an address label."""
    image = card(rng, size)
    dark = (84, 58, 36)
    cv2.rectangle(image, (0, 0), (size - 1, size - 1), (150, 112, 72), 2)
    if not is_printed:
        return image
    name = WORDS[int(rng.integers(len(WORDS)))].upper()
    cv2.putText(image, name, (size // 12, size * 3 // 10), cv2.FONT_HERSHEY_DUPLEX, size / 230, dark, 2, cv2.LINE_AA)
    for u in (size * 17 // 20, size * 18 // 20 + 4):
        cv2.arrowedLine(image, (u, size * 9 // 10), (u, size * 7 // 10), dark, 3, cv2.LINE_AA, 0, 0.35)
    cv2.line(image, (size * 8 // 10, size * 92 // 100), (size * 96 // 100, size * 92 // 100), dark, 3)
    left, top = size // 10, size * 9 // 20
    right, bottom = size * 11 // 20, size * 17 // 20
    cv2.rectangle(image, (left, top), (right, bottom), (240, 238, 230), -1)
    write_text(image, rng, (left + 6, top + 4), (right - left - 12, (bottom - top) // 2), line=size // 20)
    u = left + 8
    while u < right - 8:
        width = int(rng.integers(1, 4))
        cv2.rectangle(image, (u, bottom - (bottom - top) * 4 // 10), (u + width - 1, bottom - 6), (20, 20, 22), -1)
        u += width + int(rng.integers(1, 4))
    return image


def carton_top(rng: np.random.Generator, size_m: tuple[float, float], *, is_taped: bool, size: int = 256) -> Image:
    """Two flaps that meet in the middle line along x, under a strip of tape."""
    image = card(rng, size)
    middle = size // 2
    if is_taped:
        half = max(3, int(size * 0.025 / size_m[1]))
        strip = image[middle - half : middle + half]
        strip[:] = tape(rng, size)[middle - half : middle + half]
    cv2.line(image, (0, middle), (size - 1, middle), (120, 88, 56) if not is_taped else (150, 118, 76), 2)
    cv2.rectangle(image, (0, 0), (size - 1, size - 1), (150, 112, 72), 2)
    return image


def tape(rng: np.random.Generator, size: int = 32) -> Image:
    """Brown parcel tape, lighter where it shines."""
    return tinted((202, 168, 116), 1 + np.float32(0.05) * noise(rng, (size, size), 4, octaves=2))


AROUND = 3
"""What goes once around a cup or a bottle is about this many times as wide as high: it is drawn so, then narrowed."""


def _narrowed(wide: Image) -> Image:
    """A drawing of (size, AROUND * size) as a square."""
    rows, columns = wide.shape[:2]
    parts = wide.reshape(rows, columns // AROUND, AROUND, 3).astype(np.uint16)
    return ((parts[:, :, 0] + parts[:, :, 1] + parts[:, :, 2]) // AROUND).astype(np.uint8)


def _wide(rng: np.random.Generator, colour: Colour, size: int, contrast: float) -> Image:
    shape = (size, AROUND * size)
    return tinted(colour, 1 + np.float32(contrast) * noise(rng, shape, 6 * AROUND))


def glaze(rng: np.random.Generator, look: str, size: int = 256) -> Image:
    """The outside of a cup, once around: columns run around it, the first row is at the rim.

    Args:
        rng: generator.
        look: "white" with a print, "red" plain, "blue" over bare clay, "speckled" stoneware, "stripes".
        size: rows and columns.
    """
    if look == "white":
        image = _wide(rng, (236, 234, 226), size, 0.012)
        art = picture(rng, size // 2)
        for u in (size // 2, 2 * size):
            image[size // 5 : size // 5 + size // 2, u : u + size // 2] = art
            word = WORDS[int(rng.integers(len(WORDS)))].upper()
            at = (u, size * 17 // 20)
            cv2.putText(image, word, at, cv2.FONT_HERSHEY_DUPLEX, size / 280, (50, 56, 84), 2, cv2.LINE_AA)
        return _narrowed(image)
    if look == "red":
        image = plain(rng, (178, 38, 34), size, 0.03)
        cv2.rectangle(image, (0, 0), (size, size // 26), (226, 214, 200), -1)
        return image
    if look == "blue":
        image = plain(rng, (42, 78, 132), size, 0.07)
        edge = size * 7 // 10 + (noise(rng, (1, size), 7, octaves=3)[0] * (size / 40)).astype(np.int64)
        clay = plain(rng, (184, 152, 116), size, 0.06)
        below = np.arange(size)[:, None] > edge[None, :]
        image[below] = clay[below]
        return image
    if look == "speckled":
        image = _wide(rng, (206, 198, 180), size, 0.04)
        for u, v in rng.integers(1, (AROUND * size - 2, size - 2), (size * 3, 2)).tolist():
            cv2.circle(image, (u, v), int(rng.integers(1, 3)), (92, 74, 58), -1, cv2.LINE_AA)
        cv2.rectangle(image, (0, 0), (AROUND * size, size // 16), (112, 84, 60), -1)
        return _narrowed(image)
    image = plain(rng, (238, 234, 222), size, 0.012)
    v = size // 8
    for colour in ((212, 96, 40), (240, 186, 60), (44, 122, 126), (212, 96, 40)):
        width = int(rng.integers(size // 16, size // 9))
        cv2.rectangle(image, (0, v), (size, v + width), colour, -1)
        v += width + size // 12
    return image


def glass(rng: np.random.Generator, colour: Colour, size: int = 64) -> Image:
    """The wall of a full bottle: darker between two bright streaks of reflected light, as columns."""
    u = (np.arange(size, dtype=np.float32) + 0.5) / size
    streaks = np.zeros(size, np.float32)
    for middle, width, strength in ((0.12, 0.05, 0.55), (0.2, 0.02, 0.3), (0.62, 0.06, 0.5), (0.85, 0.02, 0.25)):
        distance = np.abs(u - np.float32(middle)) / np.float32(width)
        streaks += np.float32(strength) * np.maximum(1 - distance, 0)
    body = 1 + streaks[None, :] + np.float32(0.03) * noise(rng, (size, size), 5, octaves=2)
    return tinted(colour, body)


def bottle_label(rng: np.random.Generator, look: str, size: int = 256) -> Image:
    """A label that goes once around a bottle: of a "water" bottle, or of a "wine" bottle."""
    name = WORDS[int(rng.integers(len(WORDS)))]
    half = AROUND * size // 2
    if look == "wine":
        image = _wide(rng, (232, 222, 196), size, 0.02)
        for u0 in (0, half):
            middle = u0 + half // 2
            cv2.rectangle(image, (u0 + 8, 8), (u0 + half - 9, size - 9), (132, 100, 46), 3)
            cv2.circle(image, (middle, size * 3 // 10), size // 6, (124, 24, 36), -1, cv2.LINE_AA)
            cv2.circle(image, (middle, size * 3 // 10), size // 9, (222, 190, 110), 3, cv2.LINE_AA)
            _centred(image, name.title(), (middle, size * 13 // 20), size / 190, (44, 26, 22))
            _centred(image, str(int(rng.integers(1998, 2020))), (middle, size * 17 // 20), size / 260, (124, 24, 36))
        return _narrowed(image)
    image = _wide(rng, (28, 92, 178), size, 0.02)
    cv2.rectangle(image, (0, size * 7 // 10), (AROUND * size, size), (236, 242, 246), -1)
    for u0 in (0, half):
        hill = np.array([[0, 70], [42, 52], [60, 60], [92, 38], [150, 70]]) * size // 100 + np.array([u0, 0])
        cv2.fillPoly(image, [hill.astype(np.int32)], (226, 238, 246), cv2.LINE_AA)
        _centred(image, name.title(), (u0 + half // 2, size * 6 // 20), size / 130, (250, 250, 250))
        _centred(image, "natural water", (u0 + half // 2, size * 18 // 20), size / 300, (28, 60, 130))
    return _narrowed(image)


def _centred(image: Image, text: str, at: tuple[int, int], scale: float, colour: Colour) -> None:
    """Write a line whose middle is at (u, base line v)."""
    thick = 3 if scale > 1 else 2
    width = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, scale, thick)[0][0]
    cv2.putText(image, text, (at[0] - width // 2, at[1]), cv2.FONT_HERSHEY_DUPLEX, scale, colour, thick, cv2.LINE_AA)
