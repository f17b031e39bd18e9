"""Things of a household that lie about. Rest frame: the origin below the thing, z up, front towards -y."""

import numpy as np

from sim.scene import Surface
from sim.things import prints, textures
from sim.things.meshes import Mesh, box, lathe, merged, rounded_box, tube

Surfaces = tuple[Surface, ...]


def _ellipsoid(centre: tuple[float, float, float], radii: tuple[float, float, float], segments: int = 14) -> Mesh:
    angles = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    profile = [(max(float(np.cos(a)), 0.0), float(np.sin(a))) for a in angles]
    profile[0], profile[-1] = (0.0, -1.0), (0.0, 1.0)
    scale = np.asarray(radii)
    return lathe(profile, segments=segments, crease_deg=80).bent(lambda p: p * scale).moved(centre)


def teddy_bear(rng: np.random.Generator) -> Surfaces:
    """A sitting teddy bear, 0.32 m high."""
    fur = merged(
        _ellipsoid((0, 0, 0.095), (0.085, 0.075, 0.095)),
        _ellipsoid((0, -0.01, 0.235), (0.072, 0.066, 0.066)),
        *(_ellipsoid((s * 0.055, 0.0, 0.295), (0.026, 0.014, 0.026), 10) for s in (-1, 1)),
        *(_ellipsoid((s * 0.09, -0.045, 0.125), (0.026, 0.06, 0.028), 10) for s in (-1, 1)),
        *(_ellipsoid((s * 0.06, -0.12, 0.034), (0.034, 0.075, 0.034), 10) for s in (-1, 1)),
    )
    pale = merged(
        _ellipsoid((0, -0.066, 0.22), (0.032, 0.026, 0.025), 10),
        *(_ellipsoid((s * 0.06, -0.19, 0.036), (0.022, 0.008, 0.022), 10) for s in (-1, 1)),
    )
    dark = merged(
        _ellipsoid((0, -0.092, 0.227), (0.011, 0.007, 0.008), 8),
        *(_ellipsoid((s * 0.026, -0.068, 0.256), (0.008, 0.006, 0.008), 8) for s in (-1, 1)),
    )
    colour = (int(rng.integers(120, 180)), int(rng.integers(80, 116)), int(rng.integers(40, 70)))
    return (
        fur.surface(textures.cloth(rng, colour, 128)),
        pale.surface(textures.cloth(rng, (214, 186, 146), 64)),
        dark.surface(textures.plain(rng, (26, 22, 22), 16)),
    )


def globe(rng: np.random.Generator) -> Surfaces:
    """A globe on its foot, 0.36 m high."""
    ball = _ellipsoid((0, 0, 0.22), (0.12, 0.12, 0.12), 24)
    arc = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 10)
    bow = np.stack([0.132 * np.cos(arc), np.zeros(10), 0.22 + 0.132 * np.sin(arc)], axis=1)
    foot = merged(lathe([(0, 0), (0.08, 0), (0.075, 0.015), (0.015, 0.03), (0.012, 0.09), (0, 0.09)], segments=16))
    return (
        ball.surface(_map(rng)),
        merged(foot, tube(bow, 0.006, segments=6)).surface(textures.plain(rng, (108, 84, 52), 32)),
    )


def _map(rng: np.random.Generator, size: int = 256) -> textures.Image:
    """Continents in a sea: wherever a noise is high."""
    heights = textures.noise(rng, (size, size), 4)
    low, high = float(heights.min()), float(heights.max())
    level = (heights - low) / (high - low)
    image = np.empty((size, size, 3), np.uint8)
    image[...] = (60, 112, 168)
    image[level > 0.52] = (146, 168, 92)
    image[level > 0.62] = (196, 172, 104)
    image[level > 0.74] = (150, 110, 78)
    image[(level > 0.505) & (level <= 0.52)] = (28, 54, 96)
    return image


def ball(rng: np.random.Generator, radius_m: float = 0.11) -> Surfaces:
    """A printed ball."""
    return (_ellipsoid((0, 0, radius_m), (radius_m, radius_m, radius_m), 24).surface(prints.picture(rng, 128)),)


def partition(rng: np.random.Generator, width_m: float, height_m: float) -> Surfaces:
    """A screen between two desks, covered with cloth, on two feet."""
    cloth = box((0, 0, 0.1 + (height_m - 0.1) / 2), (width_m, 0.05, height_m - 0.1), texture_m=0.7)
    frame = merged(
        *(rounded_box((s * (width_m / 2 - 0.02), 0, height_m / 2), (0.04, 0.06, height_m), 0.012) for s in (-1, 1)),
        *(box((s * (width_m / 2 - 0.02), 0, 0.015), (0.05, 0.3, 0.03)) for s in (-1, 1)),
        box((0, 0, height_m), (width_m, 0.06, 0.03)),
    )
    return (
        cloth.surface(textures.cloth(rng, (112, 124, 146), 512)),
        frame.surface(textures.plain(rng, (138, 140, 144), 32)),
    )
