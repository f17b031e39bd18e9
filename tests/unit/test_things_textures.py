"""Textures and prints: their format, their repeatability, and that none repeats itself within."""

import hashlib

import cv2
import numpy as np
import pytest

from sim.randomness import child
from sim.things import prints, textures

SQUARE = {
    "plain": lambda rng: textures.plain(rng, (90, 120, 150)),
    "carpet": lambda rng: textures.carpet(rng, 512),
    "wood": lambda rng: textures.wood(rng, 256),
    "ceiling": lambda rng: textures.ceiling(rng, 256),
    "cloth": lambda rng: textures.cloth(rng, (46, 74, 142)),
    "leaf": textures.leaf,
    "picture": lambda rng: prints.picture(rng, 256),
    "poster": lambda rng: prints.poster(rng, 256),
    "book_spines": lambda rng: prints.book_spines(rng, 256),
    "screen": lambda rng: prints.screen(rng, 512),
    "keyboard": prints.keyboard,
    "paper": prints.paper,
    "whiteboard": lambda rng: prints.whiteboard(rng, 256),
    "cork_board": prints.cork_board,
    "label": lambda rng: prints.label(rng, (200, 60, 40)),
    "outdoors": lambda rng: prints.outdoors(rng, 256),
    "clock_face": prints.clock_face,
}
WALLS = {
    "plaster": lambda rng: textures.plaster(rng, (256, 512)),
    "brick": lambda rng: textures.brick(rng, (512, 1024), (2.8, 6.0)),
}


@pytest.mark.parametrize("name", SQUARE)
def test_is_a_square_rgb_image_with_a_power_of_two(name):
    image = SQUARE[name](child(0, name))
    size = image.shape[0]
    assert image.shape == (size, size, 3)
    assert size & (size - 1) == 0
    assert image.dtype == np.uint8
    assert image.std() > 1  # something is on it


@pytest.mark.parametrize("name", [*SQUARE, *WALLS])
def test_same_seed_same_bytes_other_seed_other_bytes(name):
    make = (SQUARE | WALLS)[name]
    first, again, other = (make(child(seed, name)).tobytes() for seed in (0, 0, 1))
    assert first == again
    assert first != other


def test_bytes_do_not_depend_on_the_number_of_opencv_threads():
    def digest() -> str:
        return hashlib.sha256(b"".join(make(child(3, n)).tobytes() for n, make in (SQUARE | WALLS).items())).hexdigest()

    before = cv2.getNumThreads()
    digests = set()
    try:
        for threads in (1, 2, 5):
            cv2.setNumThreads(threads)
            digests.add(digest())
    finally:
        cv2.setNumThreads(before)
    assert len(digests) == 1


@pytest.mark.parametrize("name", ["carpet", "plaster", "brick", "ceiling"])
def test_large_textures_do_not_repeat_themselves(name):
    """The autocorrelation stays low away from its centre and axes: no shift shows the same picture again.

    Along the axes it is not looked at: there a straight joint lies on itself.
    """
    grey = (SQUARE | WALLS)[name](child(0, name)).mean(axis=2)
    field = grey - cv2.GaussianBlur(grey, (0, 0), 12)
    field = (field - field.mean()) / field.std()
    spectrum = np.fft.rfft2(field)
    correlation = np.fft.irfft2(spectrum * np.conj(spectrum), s=field.shape) / field.size
    assert correlation[0, 0] == pytest.approx(1.0)
    rows, columns = field.shape
    correlation = np.fft.fftshift(correlation)
    near = max(rows, columns) // 12  # a brick's own size
    correlation[rows // 2 - near : rows // 2 + near + 1, columns // 2 - near : columns // 2 + near + 1] = 0
    correlation[rows // 2 - 8 : rows // 2 + 9] = 0
    correlation[:, columns // 2 - 8 : columns // 2 + 9] = 0
    assert correlation.max() < 0.35


def test_autocorrelation_test_would_find_a_tile():
    tile = textures.carpet(child(0, "tile"), 256).mean(axis=2)
    field = np.tile(tile, (2, 2))
    field = (field - field.mean()) / field.std()
    spectrum = np.fft.rfft2(field)
    correlation = np.fft.irfft2(spectrum * np.conj(spectrum), s=field.shape) / field.size
    assert correlation[256, 256] == pytest.approx(1.0)


@pytest.mark.parametrize("octaves", [1, 3, 6])
def test_noise_has_about_zero_mean_and_unit_variance(octaves):
    fields = np.stack([textures.noise(child(seed, "n"), (96, 160), 6, octaves=octaves) for seed in range(30)])
    assert abs(fields.mean()) < 0.15
    assert 0.6 < fields.std() < 1.3


def test_posters_and_screens_hold_features():
    """Corners at the size that they have in an image, a quarter of a view."""
    for make in (prints.poster, prints.screen, prints.cork_board, prints.book_spines):
        image = cv2.resize(make(child(0, "f")), (160, 120), interpolation=cv2.INTER_AREA)
        corners = cv2.goodFeaturesToTrack(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), 1000, 0.01, 4)
        assert len(corners) > 60


def test_book_spines_end_in_the_pages():
    image = prints.book_spines(child(0, "b"), 256, 10)
    pages = image[:, int(256 * (1 - 0.9 * prints.BOOK_PAGES)) :]
    assert pages.mean() > 190
    assert np.array_equal(pages[0], pages[-1])
