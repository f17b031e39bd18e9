"""Under which circumstances an instance was to be found, and whether it was."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dotmask.evaluation.matching import mask_ious, match_detections
from dotmask.geometry import inverse, project, transform
from dotmask.records import Detections, FloatArray, MaskImage
from scenarios.bridge import intrinsics_from_camera
from scenarios.faults.missing import roll_deg
from scenarios.oracle import MIN_PIXELS
from scenarios.segmenter_evaluation.report import Band
from sim.records import GroundTruth, ObjectTruth, SimFrame
from sim.simulator import Simulator


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One visible instance in one frame.

    Attributes:
        class_name: of the instance.
        iou: with the detection of its class that it was matched to; None where it was missed.
        visible_px: how many pixels of it are seen.
        hidden_percent: how much of what is inside the image something else hides.
        distance_m: from the camera to its centre.
        tilt_deg: by how much the camera is rolled.
        is_truncated: whether it touches the image's border.
        blur_px: how far its centre moves in the image while the shutter is open.
    """

    class_name: str
    iou: float | None
    visible_px: int
    hidden_percent: float
    distance_m: float
    tilt_deg: float
    is_truncated: bool
    blur_px: float


def sightings_of(
    frame: SimFrame, selected: Detections, class_names: Sequence[str], simulator: Simulator
) -> tuple[Sighting, ...]:
    """Every visible actor of the classes in a frame.

    Args:
        frame: with its truth.
        selected: what the method would use of the segmenter's answer.
        class_names: of interest.
        simulator: that made the frame.
    """
    truth = frame.truth
    ious = mask_ious(selected.masks, truth.instance_ids)
    found = {}
    for index, instance in enumerate(match_detections(ious)):
        if instance is not None:
            found[instance] = (selected.class_names[index], float(ious[index, instance]))
    sightings = []
    for actor in visible_actors(truth, class_names):
        class_name, iou = found.get(actor.instance_id, (None, 0.0))
        sightings.append(
            Sighting(
                class_name=actor.class_name,
                iou=iou if class_name == actor.class_name else None,
                visible_px=actor.visible_pixels,
                hidden_percent=100 * actor.occlusion,
                distance_m=float(np.linalg.norm(actor.centre_world - truth.T_world_camera[:3, 3])),
                tilt_deg=roll_deg(truth.T_world_camera),
                is_truncated=actor.is_truncated,
                blur_px=_blur_px(actor, frame, simulator),
            )
        )
    return tuple(sightings)


def visible_actors(truth: GroundTruth, class_names: Sequence[str]) -> tuple[ObjectTruth, ...]:
    """The actors of the classes that show enough pixels to be found."""
    return tuple(a for a in truth.objects if a.class_name in class_names and a.visible_pixels >= MIN_PIXELS)


REASONABLE_HEIGHT_PX, REASONABLE_OCCLUSION = 50, 0.35


def is_reasonable(actor: ObjectTruth, mask: MaskImage) -> bool:
    """Whether an actor is high enough and little enough hidden for the reasonable setting of pedestrian detection.

    Dollár et al., Pedestrian detection: an evaluation of the state of the art, TPAMI 2012. Its height is that of the
    whole person; here it is that of what is seen.

    Args:
        actor: in a frame.
        mask: (H, W) its pixels there.
    """
    rows = np.flatnonzero(mask.any(axis=1))
    height_px = int(rows[-1] - rows[0] + 1) if rows.size else 0
    return height_px >= REASONABLE_HEIGHT_PX and actor.occlusion <= REASONABLE_OCCLUSION


def _blur_px(actor: ObjectTruth, frame: SimFrame, simulator: Simulator) -> float:
    """Way of the actor's centre in the image during the exposure, pixels; 0 where the image is taken at once."""
    half_s = simulator.sensor.timing.exposure_s / 2
    if half_s == 0:
        return 0.0
    time_s, last_s = simulator.time_s(frame.index), simulator.time_s(len(simulator) - 1)
    ends: list[FloatArray] = []
    for sign in (-1, 1):
        # Before the first and after the last capture the world stands still.
        at_s = min(max(time_s + sign * half_s, 0.0), last_s)
        centre_world = actor.centre_world + (at_s - time_s) * actor.velocity_world
        centre_camera = transform(inverse(simulator.moment(at_s).T_world_camera), centre_world[None])
        ends.append(project(centre_camera, intrinsics_from_camera(frame.camera))[0])
    return float(np.linalg.norm(ends[1] - ends[0]))


SIZES_PX, HIDDEN_PERCENT = (0, 32**2, 96**2), (0, 10, 50, 80)
DISTANCES_M, TILTS_DEG, BLURS_PX = (0, 1, 2, 3, 4, 6), (0, 10, 30, 60, 90), (0, 1, 3, 8)
"""Lower ends of the bands; the last one is open. The sizes are COCO's small, medium and large."""


def misses(sightings: Sequence[Sighting]) -> dict[str, tuple[Band, ...]]:
    """Seen and missed by circumstance; bands in which nothing was seen are left out."""

    def bands(starts: Sequence[int], value: Callable[[Sighting], float]) -> tuple[Band, ...]:
        made = [
            band(f"{low} to {high}", [s for s in sightings if low <= value(s) < high]) for low, high in pairwise(starts)
        ]
        made.append(band(f"{starts[-1]} and more", [s for s in sightings if value(s) >= starts[-1]]))
        return tuple(one for one in made if one.seen)

    cut = [
        band(name, [s for s in sightings if s.is_truncated == is_cut])
        for name, is_cut in (("no", False), ("yes", True))
    ]
    return {
        "visible_px": bands(SIZES_PX, lambda s: s.visible_px),
        "hidden_percent": bands(HIDDEN_PERCENT, lambda s: s.hidden_percent),
        "distance_m": bands(DISTANCES_M, lambda s: s.distance_m),
        "tilt_deg": bands(TILTS_DEG, lambda s: s.tilt_deg),
        "truncated": tuple(one for one in cut if one.seen),
        "blur_px": bands(BLURS_PX, lambda s: s.blur_px),
    }


def band(label: str, sightings: Sequence[Sighting]) -> Band:
    """How many of the sightings were missed."""
    missed = sum(s.iou is None for s in sightings)
    return Band(
        label=label,
        seen=len(sightings),
        missed=missed,
        missed_share=missed / len(sightings) if sightings else None,
    )
