"""Printed, painted and written things as images: posters, pages, books, screens, labels, views.

The same rules as in `sim.things.textures`: by generator, square, a power of two, first row at the top, and bytes that
do not depend on the machine.
"""

from itertools import pairwise

import cv2
import numpy as np

from sim.things.textures import Colour, Image, noise, plain, tinted

WORDS = (
    "lorem", "ipsum", "dolor", "sit", "amet", "localization", "mapping", "depth", "robot", "filter", "mask", "track",
    "frame", "loop", "closure", "graph", "sensor", "kalman", "object", "scene", "camera", "pose", "feature", "budget",
    "meeting", "report", "monday", "deadline", "coffee", "idea", "draft", "result",
)  # fmt: skip
BOOK_PAGES = 1 / 16
"""Share of a `book_spines` texture at its right edge that shows the paper of the pages."""


def _colour(rng: np.random.Generator, low: int, high: int) -> Colour:
    """A colour with channels in [low, high), of any strength: most print and paint is not pure."""
    red, green, blue = (int(v) for v in rng.integers(low, high, 3))
    grey = (red + green + blue) // 3
    strength = int(rng.integers(30, 90))
    red, green, blue = (grey + (v - grey) * strength // 100 for v in (red, green, blue))
    return red, green, blue


def write_text(
    image: Image,
    rng: np.random.Generator,
    corner: tuple[int, int],
    extent: tuple[int, int],
    *,
    line: int = 14,
    colour: Colour = (35, 35, 40),
) -> None:
    """Fill the rectangle at `corner` (u, v) with `extent` (width, height) with lines of random words."""
    scale = line / 36
    for base in range(corner[1] + line, corner[1] + extent[1] + 1, line):
        u, end = corner[0], corner[0] + int(extent[0] * rng.uniform(0.55, 1.0))
        while u < end:
            word = WORDS[int(rng.integers(len(WORDS)))]
            width = cv2.getTextSize(word, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0]
            if u + width > corner[0] + extent[0]:
                break
            cv2.putText(image, word, (u, base), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
            u += width + line // 2


def picture(rng: np.random.Generator, size: int) -> Image:
    """An abstract painting: a coloured ground with shapes."""
    first, second, third = (np.array(_colour(rng, 40, 240)) for _ in range(3))
    part = np.linspace(0.0, 1.0, 128)[:, None]
    palette = np.concatenate([first + (second - first) * part, second + (third - second) * part]).astype(np.uint8)
    t = noise(rng, (size, size), 3, octaves=5) * np.float32(60) + np.float32(128)
    image: Image = np.take(palette, np.clip(t, 0, 255).astype(np.uint8), axis=0)
    for _ in range(26):
        u, v = (int(x) for x in rng.integers(0, size, 2))
        kind, colour = int(rng.integers(4)), _colour(rng, 0, 256)
        extent = int(rng.integers(size // 40 + 2, size // 9 + 3))
        if kind == 0:
            cv2.circle(image, (u, v), extent, colour, -1, cv2.LINE_AA)
        elif kind == 1:
            cv2.rectangle(image, (u, v), (u + 2 * extent, v + extent), colour, -1)
        elif kind == 2:
            corners = rng.integers(-extent, extent, (4, 2)) + np.array([u, v])
            cv2.fillPoly(image, [corners.astype(np.int32)], colour, cv2.LINE_AA)
        else:
            cv2.circle(image, (u, v), extent, colour, max(2, extent // 6), cv2.LINE_AA)
    return image


def poster(rng: np.random.Generator, size: int = 512) -> Image:
    """A title, a painting or a plot, and two columns of text."""
    paper = _colour(rng, 195, 250)
    image = plain(rng, paper, size, 0.01)
    margin = size // 16
    band = _colour(rng, 20, 120)
    cv2.rectangle(image, (0, 0), (size, size // 6), band, -1)
    title = f"{WORDS[int(rng.integers(len(WORDS)))].upper()} {int(rng.integers(1950, 2030))}"
    cv2.putText(image, title, (margin, size // 8), cv2.FONT_HERSHEY_DUPLEX, size / 420, (240, 240, 235), 2, cv2.LINE_AA)
    half = size * 7 // 16
    top, left = size // 6 + margin // 2, margin
    art = picture(rng, size)[:half, : size - 2 * margin]
    image[top : top + half, left : left + art.shape[1]] = art
    text_top = top + half + margin // 2
    column = (size - 3 * margin) // 2
    for u in (margin, 2 * margin + column):
        write_text(image, rng, (u, text_top), (column, size - text_top - margin // 2), line=size // 34)
    return image


def book_spines(rng: np.random.Generator, size: int = 512, count: int = 24) -> Image:
    """`count` spines side by side, each of `(1 - BOOK_PAGES) * size / count` columns, then a strip of page edges."""
    image = np.empty((size, size, 3), np.uint8)
    wear = 1 + np.float32(0.04) * noise(rng, (size, size), 30, octaves=3)
    width = (size - int(size * BOOK_PAGES)) / count
    for book in range(count):
        left, right = round(book * width), round((book + 1) * width)
        colour = _colour(rng, 25, 235)
        image[:, left:right] = tinted(colour, wear[:, left:right])
        contrast = tuple((c + 128) % 256 for c in colour)
        for _ in range(int(rng.integers(1, 4))):
            v = int(rng.integers(0, size - size // 20))
            cv2.rectangle(image, (left, v), (right - 1, v + int(rng.integers(2, size // 24 + 3))), contrast, -1)
        title = np.zeros((right - left, size), np.uint8)
        text = " ".join(WORDS[int(k)] for k in rng.integers(0, len(WORDS), 3))
        start = (int(rng.integers(size // 20, size // 4)), int((right - left) * 0.7))
        cv2.putText(
            title, text, start, cv2.FONT_HERSHEY_SIMPLEX, (right - left) / 34, 255, 2 if size > 400 else 1, cv2.LINE_AA
        )
        letters = np.rot90(title, -1) > 90
        image[:, left:right][letters] = 240 if sum(colour) < 400 else 25
    pages = round(count * width)
    lines = 0.92 + 0.08 * rng.random(size - pages)
    image[:, pages:] = (np.array([232.0, 226.0, 206.0]) * lines[:, None]).astype(np.uint8)
    return image


def screen(rng: np.random.Generator, size: int = 512) -> Image:
    """An editor with coloured text beside a white plot, drawn to be shown 16 wide and 10 high."""
    image = np.empty((size, size, 3), np.uint8)
    image[:] = (38, 42, 54)
    image[: size // 22] = (78, 84, 104)
    palette = ((222, 222, 222), (240, 160, 90), (120, 200, 130), (110, 170, 250), (210, 130, 220), (240, 220, 110))
    line = size // 28
    for v in range(size // 11, size - line, line):
        u = size // 40 + int(rng.integers(0, 5)) * size // 28
        for _ in range(int(rng.integers(0, 7))):
            word = WORDS[int(rng.integers(len(WORDS)))]
            width = cv2.getTextSize(word, cv2.FONT_HERSHEY_SIMPLEX, line / 40, 1)[0][0]
            if u + width > 0.6 * size:
                break
            colour = palette[int(rng.integers(len(palette)))]
            cv2.putText(image, word, (u, v), cv2.FONT_HERSHEY_SIMPLEX, line / 40, colour, 1, cv2.LINE_AA)
            u += width + line // 2
    left, right = int(0.64 * size), int(0.97 * size)
    for top, bottom in ((0.1, 0.5), (0.55, 0.94)):
        first, last = int(top * size), int(bottom * size)
        cv2.rectangle(image, (left, first), (right, last), (246, 246, 246), -1)
        for _ in range(3):
            walk = np.cumsum(rng.integers(-5, 6, right - left)) + (first + last) // 2
            points = np.stack([np.arange(left, right), np.clip(walk, first + 3, last - 3)], axis=1)
            cv2.polylines(image, [points.astype(np.int32)], False, _colour(rng, 0, 220), 2, cv2.LINE_AA)
    return image


def desktop(rng: np.random.Generator, size: int = 512) -> Image:
    """A wallpaper with a view, icons, two windows and a task bar, drawn to be shown 16 wide and 10 high."""
    image = outdoors(rng, size)
    for v in range(size // 14, size * 3 // 4, size // 8):
        corner = (size // 40, v)
        cv2.rectangle(image, corner, (corner[0] + size // 26, v + size // 17), _colour(rng, 60, 250), -1)
    for left, top, right, bottom in ((0.16, 0.12, 0.6, 0.72), (0.5, 0.34, 0.94, 0.86)):
        first, last = (int(left * size), int(top * size)), (int(right * size), int(bottom * size))
        cv2.rectangle(image, first, last, (244, 245, 246), -1)
        cv2.rectangle(image, first, (last[0], first[1] + size // 22), (72, 92, 128), -1)
        extent = (last[0] - first[0]) * 2 // 5
        art = picture(rng, extent)
        image[first[1] + size // 14 : first[1] + size // 14 + extent, first[0] + 8 : first[0] + 8 + extent] = art
        text = (first[0] + extent + 16, first[1] + size // 18)
        write_text(image, rng, text, (last[0] - text[0] - 6, last[1] - text[1] - 8), line=size // 30)
    cv2.rectangle(image, (0, size - size // 18), (size, size), (30, 34, 44), -1)
    for u in range(size // 40, size // 3, size // 22):
        cv2.rectangle(image, (u, size - size // 22), (u + size // 32, size - size // 90), _colour(rng, 80, 250), -1)
    return image


def keyboard(rng: np.random.Generator, size: int = 256) -> Image:
    """Keys in five rows, drawn to be shown three times as wide as high."""
    image = plain(rng, (38, 38, 42), size, 0.02)
    row_height = size / 5.4
    for row in range(5):
        u, v = size * 0.02, (row + 0.2) * row_height
        while u < 0.95 * size:
            width = size * (0.058 if rng.random() < 0.85 else 0.11)
            corner, opposite = (int(u), int(v)), (int(min(u + width, 0.985 * size)), int(v + 0.82 * row_height))
            cv2.rectangle(image, corner, opposite, (88, 88, 94), -1)
            letter = chr(65 + int(rng.integers(26)))
            cv2.putText(
                image, letter, (corner[0] + 2, int(v + 0.6 * row_height)), 0, 0.38, (228, 228, 228), 1, cv2.LINE_AA
            )
            u += width + size * 0.008
    return image


def paper(rng: np.random.Generator, size: int = 256) -> Image:
    """A printed page: heading, text, sometimes a figure, sometimes marker."""
    image = plain(rng, (242, 241, 236), size, 0.008)
    margin = size // 12
    cv2.putText(
        image,
        WORDS[int(rng.integers(len(WORDS)))].title(),
        (margin, 2 * margin),
        0,
        size / 420,
        (20, 20, 25),
        2,
        cv2.LINE_AA,
    )
    write_text(image, rng, (margin, 2 * margin), (size - 2 * margin, size - 3 * margin), line=max(8, size // 22))
    if rng.random() < 0.6:
        extent = int(size * rng.uniform(0.25, 0.4))
        v = int(rng.integers(size // 3, size - extent - margin))
        image[v : v + extent, size - margin - extent : size - margin] = picture(rng, extent)
    for _ in range(int(rng.integers(0, 4))):
        v = int(rng.integers(size // 4, size - margin))
        u = int(rng.integers(margin, size // 2))
        strip = image[v : v + size // 30 + 2, u : u + size // 4]
        strip[..., 2] = strip[..., 2] // 2
    return image


def whiteboard(rng: np.random.Generator, size: int = 512) -> Image:
    """Boxes, arrows, a plot and handwriting in marker colours."""
    image = plain(rng, (238, 240, 240), size, 0.012)
    inks = ((30, 40, 150), (180, 30, 40), (20, 120, 50), (30, 30, 34))
    boxes = []
    for _ in range(9):
        u, v = int(rng.integers(size // 30, size * 3 // 4)), int(rng.integers(size // 20, size * 4 // 5))
        width, height = int(rng.integers(size // 10, size // 5)), int(rng.integers(size // 14, size // 8))
        ink = inks[int(rng.integers(4))]
        cv2.rectangle(image, (u, v), (u + width, v + height), (244, 246, 246), -1)
        cv2.rectangle(image, (u, v), (u + width, v + height), ink, 2)
        word = WORDS[int(rng.integers(len(WORDS)))]
        cv2.putText(
            image, word, (u + 6, v + height * 2 // 3), cv2.FONT_HERSHEY_SCRIPT_SIMPLEX, size / 1000, ink, 1, cv2.LINE_AA
        )
        boxes.append((u + width // 2, v + height))
    for start, end in pairwise(boxes):
        cv2.arrowedLine(image, start, end, inks[int(rng.integers(4))], 2, cv2.LINE_AA, 0, 0.06)
    for _ in range(14):
        at = int(rng.integers(0, size * 3 // 4)), int(rng.integers(size // 16, size))
        word = f"{WORDS[int(rng.integers(len(WORDS)))]} = {int(rng.integers(2, 999)) / 10}"
        cv2.putText(
            image, word, at, cv2.FONT_HERSHEY_SCRIPT_SIMPLEX, size / 900, inks[int(rng.integers(4))], 1, cv2.LINE_AA
        )
    return image


def cork_board(rng: np.random.Generator, size: int = 512) -> Image:
    """Cork with pinned pages, cards and photographs."""
    image = tinted((184, 140, 92), 1 + np.float32(0.16) * noise(rng, (size, size), size / 6, octaves=2))
    for _ in range(17):
        width, height = int(size * rng.uniform(0.1, 0.22)), int(size * rng.uniform(0.1, 0.24))
        u, v = int(rng.integers(4, size - width - 4)), int(rng.integers(4, size - height - 4))
        kind = int(rng.integers(3))
        if kind == 0:
            sheet = paper(rng, 128)
        elif kind == 1:
            sheet = picture(rng, 128)
        else:
            sheet = plain(rng, _colour(rng, 150, 250), 128, 0.01)
            write_text(sheet, rng, (8, 8), (112, 112), line=20)
        cv2.rectangle(image, (u + 3, v + 3), (u + width + 3, v + height + 3), (96, 72, 46), -1)
        rows, columns = np.arange(height) * 128 // height, np.arange(width) * 128 // width
        image[v : v + height, u : u + width] = sheet[rows[:, None], columns]
        cv2.circle(image, (u + width // 2, v + 5), 4, _colour(rng, 0, 256), -1, cv2.LINE_AA)
    return image


def label(rng: np.random.Generator, ground: Colour, size: int = 128) -> Image:
    """The wrapping of a cup, bottle, can or box: bands, a picture, a name."""
    image = plain(rng, ground, size, 0.02)
    top, bottom = int(size * rng.uniform(0.25, 0.4)), int(size * rng.uniform(0.7, 0.85))
    cv2.rectangle(image, (0, top), (size, bottom), _colour(rng, 60, 255), -1)
    cv2.rectangle(image, (0, top), (size, top + 3), _colour(rng, 0, 255), -1)
    art = picture(rng, bottom - top - 6)
    image[top + 4 : top + 4 + art.shape[0], size // 8 : size // 8 + art.shape[1]] = art
    name = WORDS[int(rng.integers(len(WORDS)))].upper()
    for u in (size * 5 // 8, size // 6):
        cv2.putText(
            image, name, (u, bottom - 8), cv2.FONT_HERSHEY_DUPLEX, size / 300, _colour(rng, 0, 120), 1, cv2.LINE_AA
        )
    return image


def outdoors(rng: np.random.Generator, size: int = 512) -> Image:
    """What one sees through a window: sky, houses with irregular windows, trees."""
    image = np.empty((size, size, 3), np.uint8)
    t = np.linspace(0, 1, size, dtype=np.float32)[:, None]
    for k, (top, low) in enumerate(((150, 226), (190, 232), (236, 240))):
        image[..., k] = top + (low - top) * t
    u = 0
    while u < size:
        width, roof = int(rng.integers(size // 10, size // 4)), int(rng.integers(size // 4, size * 6 // 10))
        cv2.rectangle(image, (u, roof), (u + width, size), _colour(rng, 90, 200), -1)
        for _ in range(16):
            at_u, at_v = int(rng.integers(u, u + width)), int(rng.integers(roof + 4, size))
            extent = int(rng.integers(size // 60 + 2, size // 30 + 3))
            cv2.rectangle(image, (at_u, at_v), (at_u + extent, at_v + extent * 3 // 2), _colour(rng, 30, 110), -1)
        u += width
    for _ in range(60):
        at = int(rng.integers(0, size)), int(rng.integers(size * 7 // 10, size))
        green = (int(rng.integers(40, 90)), int(rng.integers(90, 150)), int(rng.integers(40, 80)))
        cv2.circle(image, at, int(rng.integers(size // 50, size // 18)), green, -1, cv2.LINE_AA)
    return image


def clock_face(rng: np.random.Generator, size: int = 128) -> Image:
    """Twelve numbers and two hands."""
    image = plain(rng, (240, 240, 236), size, 0.01)
    middle = size // 2
    places = (
        (0, -40),
        (20, -35),
        (35, -20),
        (40, 0),
        (35, 20),
        (20, 35),
        (0, 40),
        (-20, 35),
        (-35, 20),
        (-40, 0),
        (-35, -20),
        (-20, -35),
    )
    for hour, (du, dv) in enumerate(places):
        at = (middle + du * size // 100 - size // 22, middle + dv * size // 100 + size // 28)
        cv2.putText(image, str(hour or 12), at, 0, size / 330, (20, 20, 24), 1, cv2.LINE_AA)
    for length in (22, 32):
        du, dv = places[int(rng.integers(12))]
        end = (middle + du * length * size // 4000, middle + dv * length * size // 4000)
        cv2.line(image, (middle, middle), end, (20, 20, 24), 3, cv2.LINE_AA)
    return image
