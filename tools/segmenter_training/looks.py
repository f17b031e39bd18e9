"""Other colours and patterns for what is rendered in the training, so that the network learns shapes."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.scene import SceneObject, Surface
from sim.things import textures
from sim.things.textures import Image

CLOTHES = ("shirt", "collar", "trousers", "shoes")
PATTERN_PX = 256


def varied_person(person: SceneObject, surface_names: Sequence[str], rng: np.random.Generator) -> SceneObject:
    """A person in other clothes, with another skin and other hair; one in five stays as baked.

    Args:
        person: to vary.
        surface_names: what each of its surfaces is.
        rng: of the draw.
    """
    if rng.random() < 0.2:
        return person
    tone = rng.uniform(0.4, 1.15) * rng.uniform(0.93, 1.07, 3)
    surfaces = []
    for name, surface in zip(surface_names, person.surfaces, strict=True):
        if name in CLOTHES and rng.random() < 0.5:
            texture = pattern(rng)
        elif name in CLOTHES or name == "hair":
            texture = recoloured(surface.texture, rng)
        elif name == "skin":
            texture = _scaled(surface.texture, tone)
        else:
            texture = surface.texture
        surfaces.append(replace(surface, texture=texture))
    return replace(person, surfaces=tuple(surfaces))


def varied_thing(thing: SceneObject, rng: np.random.Generator, share: float) -> SceneObject:
    """A thing with this share of its surfaces in other colours."""
    return replace(thing, surfaces=tuple(_varied(surface, rng, share) for surface in thing.surfaces))


def tinted_thing(thing: SceneObject, rng: np.random.Generator, share: float) -> SceneObject:
    """Furniture or a wall with this share of its surfaces tinted and darkened."""
    surfaces = []
    for surface in thing.surfaces:
        if rng.random() < share:
            surface = replace(
                surface, texture=_scaled(surface.texture, rng.uniform(0.55, 1.1) * rng.uniform(0.8, 1.1, 3))
            )
        surfaces.append(surface)
    return replace(thing, surfaces=tuple(surfaces))


def recoloured(texture: Image, rng: np.random.Generator) -> Image:
    """An image (S, S, 3) with another hue, saturation and brightness."""
    hsv = cv2.cvtColor(texture, cv2.COLOR_RGB2HSV)
    levels = np.arange(256)
    hue = ((levels + int(rng.integers(180))) % 180).astype(np.uint8)
    saturation = np.clip(levels * rng.uniform(0.3, 1.7) + rng.uniform(-10, 60), 0, 255).astype(np.uint8)
    value = np.clip(levels * rng.uniform(0.35, 1.5) + rng.uniform(-5, 50), 0, 255).astype(np.uint8)
    table = np.stack([hue, saturation, value], axis=1)[:, None]
    return np.asarray(cv2.cvtColor(cv2.LUT(hsv, table), cv2.COLOR_HSV2RGB), np.uint8)


def pattern(rng: np.random.Generator) -> Image:
    """A cloth (S, S, 3) of one colour, with stripes, checks or blotches of one or two others, half of them stark."""
    shape = (PATTERN_PX, PATTERN_PX)
    first, second, third = rng.integers(15, 245, (3, 3))
    if rng.random() < 0.5:
        second = rng.integers(215, 250, 3) if first.mean() < 130 else rng.integers(10, 50, 3)
    v, u = np.mgrid[:PATTERN_PX, :PATTERN_PX]
    rows, columns = (_stripes(axis, rng) for axis in (v, u))
    kind = rng.choice(["plain", "rows", "columns", "checks", "blotches"], p=(0.1, 0.35, 0.1, 0.3, 0.15))
    image = np.broadcast_to(first.astype(np.float32), (*shape, 3)).copy()
    if kind in ("rows", "checks"):
        image[rows] = second
    if kind in ("columns", "checks"):
        image[columns] = (image[columns] + third) / 2
    if kind == "blotches":
        image[textures.noise(rng, shape, float(rng.uniform(4, 20)), octaves=3) > rng.uniform(0.2, 1.0)] = second
    shade = 1 + np.float32(0.1) * textures.noise(rng, shape, 12, octaves=4)
    return np.asarray(np.clip(image * shade[..., None], 0, 255), np.uint8)


def _stripes(place: npt.NDArray[np.int64], rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    """Where along an axis the stripes lie; they and the gaps between them may differ in width."""
    period = int(rng.integers(6, 56))
    return np.less(place % period, rng.uniform(0.25, 0.75) * period)


def _varied(surface: Surface, rng: np.random.Generator, share: float) -> Surface:
    return replace(surface, texture=recoloured(surface.texture, rng)) if rng.random() < share else surface


def _scaled(texture: Image, factors: FloatArray) -> Image:
    table = np.clip(np.arange(256)[:, None] * factors, 0, 255).astype(np.uint8)[:, None]
    return np.asarray(cv2.LUT(texture, table), np.uint8)
