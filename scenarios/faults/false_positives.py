"""Detections where nothing is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dotmask.geometry import back_project, inverse, project, transform
from dotmask.records import FloatArray, Intrinsics, MaskImage
from scenarios.faults.found import Dice, Found, One, singles, together
from scenarios.oracle import CLASSES, MIN_PIXELS
from scenarios.spec import FalsePositivesSpec
from sim.records import GroundTruth

SIZE_M = {"person": (0.5, 1.7), "chair": (0.55, 0.9), "cup": (0.09, 0.1), "bottle": (0.08, 0.25)}
"""Width and height of what is seen by mistake."""

SCALES = (0.8, 1.25)
"""Its size is drawn between these times SIZE_M."""

MIN_SEMI_AXIS_PX = 12.0
"""As small as it can be when it appears: a quarter of it, in a corner of the image, has MIN_PIXELS still."""

MIN_DEPTH_M = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shown:
    """The truth of one frame."""

    frame_index: int
    truth: GroundTruth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ghost:
    """A false positive.

    Attributes:
        name: unique in the run.
        class_name: what it is taken for.
        centre_world: (3,) metres, a point on the surface of something that stands still.
        semi_axes_m: (2,) of the ellipse, across and along the image's rows, at the depth of the centre.
    """

    name: str
    class_name: str
    centre_world: FloatArray
    semi_axes_m: FloatArray


def static_pixels(truth: GroundTruth) -> MaskImage:
    """(H, W) where no actor is seen."""
    return np.isin(truth.instance_ids, [actor.instance_id for actor in truth.objects], invert=True)


def appearing(spec: FalsePositivesSpec, shown: Shown, seed: int, camera: Intrinsics) -> Iterator[Ghost]:
    """Those that are seen for the first time in a frame: a Poisson number of them, anywhere on what stands still."""
    generator = Dice(seed=seed, frame_index=shown.frame_index).throw("false positives")
    count = generator.poisson(spec.per_frame / spec.frames)
    if count == 0:
        return
    places = np.flatnonzero(static_pixels(shown.truth) & (shown.truth.depth_m > MIN_DEPTH_M))
    for number in range(count):
        class_name = CLASSES[generator.integers(len(CLASSES))]
        scale, place = generator.uniform(*SCALES), generator.random()
        if len(places) == 0:
            return
        v, u = divmod(int(places[int(place * len(places))]), camera.width)
        depth_m = float(shown.truth.depth_m[v, u])
        centre_camera = back_project(np.array([[u, v]], np.float64), np.array([depth_m]), camera)
        least_m = MIN_SEMI_AXIS_PX * depth_m / np.array([camera.fx, camera.fy])
        yield Ghost(
            name=f"ghost {shown.frame_index}/{number}",
            class_name=class_name,
            centre_world=transform(shown.truth.T_world_camera, centre_camera)[0],
            semi_axes_m=np.maximum(scale * np.array(SIZE_M[class_name]) / 2.0, least_m),
        )


def blob(ghost: Ghost, T_world_camera: FloatArray, camera: Intrinsics) -> MaskImage:
    """(H, W) the ellipse of a false positive; empty where it is out of view."""
    centre_camera = transform(inverse(T_world_camera), ghost.centre_world[None])
    depth_m = centre_camera[0, 2]
    if depth_m <= MIN_DEPTH_M:
        return np.zeros((camera.height, camera.width), np.bool_)
    u, v = project(centre_camera, camera)[0]
    a, b = ghost.semi_axes_m * np.array([camera.fx, camera.fy]) / depth_m
    columns, rows = np.arange(camera.width), np.arange(camera.height)[:, None]
    inside: MaskImage = ((columns - u) / a) ** 2 + ((rows - v) / b) ** 2 <= 1.0
    return inside


def false_positives(
    found: Found, spec: FalsePositivesSpec, past: Sequence[Shown], seed: int, camera: Intrinsics
) -> Found:
    """The detections of a frame and, after them, the false positives that appeared in it and in the frames before.

    Args:
        found: of the frame.
        spec: how many, and for how long.
        past: this frame, last, and those before it that are remembered.
        seed: of the scenario.
        camera: of all of them.
    """
    if spec.per_frame == 0:
        return found
    now = past[-1]
    static, ghosts = static_pixels(now.truth), []
    for shown in past:
        if now.frame_index - shown.frame_index >= spec.frames:
            continue
        for ghost in appearing(spec, shown, seed, camera):
            mask = blob(ghost, now.truth.T_world_camera, camera) & static
            if np.count_nonzero(mask) >= MIN_PIXELS:
                ghosts.append(One(name=ghost.name, mask=mask, class_name=ghost.class_name, score=1.0))
    if not ghosts:
        return found
    return together([*singles(found), *ghosts], static.shape)
