"""Checks of the objects: their flow, poses, velocities and keypoints, and that nothing sinks into the floor."""

import numpy as np

from scenarios.check.measure import Measured
from scenarios.check.sample import Sample, camera_points, pixels_of, posed_vertices, world_points
from sim.scene import SceneObject

INSIDE_PX = 1
"""A visible keypoint's pixel or one so near shows the person."""

KEYPOINT_NEAR_M = 0.05
"""As near as the renderers draw."""


def static_flow_error(sample: Sample) -> Measured:
    """Scene flow of what cannot move: metres."""
    flow, ids = sample.now.images.flow, sample.now.images.instance_ids
    assert flow is not None
    actors = [obj.instance_id for obj in sample.scene if obj.is_actor]
    static = ~np.isin(ids, actors)
    moved = np.abs(flow.scene_m[static])
    worst = float(moved.max()) if moved.size else None
    return Measured(worst=worst, tested=int(static.sum()), total=int(static.sum()))


def rigid_flow_error(sample: Sample) -> Measured:
    """Scene flow of an actor of rigid parts against its change of pose: metres, at all its pixels.

    An actor of one part moves as its stated pose does, a point of a jointed one as one of the bones.
    """
    flow, ids = sample.now.images.flow, sample.now.images.instance_ids
    assert flow is not None
    points = world_points(sample.now, sample.camera)
    objects = {obj.name: obj for obj in sample.scene}
    poses_then = {actor.name: actor.T_world_object for actor in sample.then.objects}
    worst: list[float] = []
    tested = 0
    for actor in sample.now.objects:
        mine = ids == actor.instance_id
        if not mine.any() or not _is_of_rigid_parts(objects[actor.name]):
            continue
        before, after = sample.now.palettes[actor.name], sample.then.palettes[actor.name]
        if len(before) == 1:
            before, after = actor.T_world_object[None], poses_then[actor.name][None]
        off = []
        for T_then_now in np.einsum("bij,bjk->bik", after, np.linalg.inv(before)):
            moved = np.einsum("ij,nj->ni", T_then_now[:3, :3], points[mine]) + T_then_now[:3, 3] - points[mine]
            off.append(np.linalg.norm(moved - flow.scene_m[mine], axis=1))
        worst.append(float(np.min(off, axis=0).max()))
        tested += int(mine.sum())
    return Measured(worst=max(worst, default=None), tested=tested, total=tested)


def _is_of_rigid_parts(obj: SceneObject) -> bool:
    """Whether every vertex follows one bone."""
    return all(surface.weights is None or bool((surface.weights.max(axis=1) == 1).all()) for surface in obj.surfaces)


def velocity_error(sample: Sample) -> Measured:
    """Stated velocity of the centre against the finite difference of the centre: metres per second.

    The difference is of fourth order in the step. What it differs from the one of second order is taken off the error:
    where the motion is rough, in a hit, a difference knows the velocity no better.
    """
    errors = []
    for actor in sample.now.objects:
        c = sample.centres[actor.name]
        second = (c[3] - c[1]) / (2 * sample.step_s)
        fourth = (8 * (c[3] - c[1]) - (c[4] - c[0])) / (12 * sample.step_s)
        roughness = np.linalg.norm(fourth - second)
        away = np.linalg.norm(actor.centre_world - c[2]) / sample.step_s
        errors.append(max(float(np.linalg.norm(actor.velocity_world - fourth) - roughness), float(away), 0.0))
    return Measured.of(errors, len(errors))


def sinking(sample: Sample) -> Measured:
    """How far an actor's surface is below the floor: metres."""
    errors = []
    for obj in sample.scene:
        if obj.is_actor:
            lowest = float(posed_vertices(obj, sample.now.palettes[obj.name])[:, 2].min())
            errors.append(max(0.0, -lowest))
    return Measured.of(errors, len(errors))


def collisions(sample: Sample) -> Measured:
    """Number of pairs, of a person and an obstacle or of two people, that overlap on the floor."""
    overlaps = sum(pair.distance_m <= 0 for pair in sample.near)
    return Measured(worst=float(overlaps) if sample.near else None, tested=len(sample.near), total=len(sample.near))


def keypoint_pixel_error(sample: Sample) -> Measured:
    """Stated pixels of the keypoints against the projections of the points: pixels.

    Of points nearer to the camera's plane than KEYPOINT_NEAR_M nothing is compared: there a pose's last bit moves the
    projection by many pixels, and nothing is drawn.
    """
    errors: list[float] = []
    for actor in sample.now.objects:
        if actor.keypoints is None:
            continue
        points = camera_points(actor.keypoints.world_m, sample.now)
        pixels = pixels_of(points, sample.camera)
        error = np.linalg.norm(pixels - actor.keypoints.pixels, axis=1)
        both_behind = np.isnan(pixels).any(axis=1) & np.isnan(actor.keypoints.pixels).any(axis=1)
        error = np.where(both_behind, 0.0, np.where(np.isnan(error), np.inf, error))
        errors += error[np.abs(points[:, 2]) > KEYPOINT_NEAR_M].tolist()
    return Measured.of(errors, len(errors))


def keypoint_visibility_error(sample: Sample) -> Measured:
    """Share of the keypoints whose visibility the images contradict.

    0 = outside the image, 1 or 2 = inside; of 2 the person is seen there.
    """
    camera, ids = sample.camera, sample.now.images.instance_ids
    errors: list[float] = []
    for actor in sample.now.objects:
        if actor.keypoints is None:
            continue
        for (u, v), visibility in zip(actor.keypoints.pixels, actor.keypoints.visibility, strict=True):
            inside = -0.5 <= u < camera.width - 0.5 and -0.5 <= v < camera.height - 0.5  # NaN is not
            is_well = inside == (visibility > 0)
            if is_well and visibility == 2:
                column, row = round(float(u)), round(float(v))
                around = ids[
                    max(row - INSIDE_PX, 0) : row + INSIDE_PX + 1, max(column - INSIDE_PX, 0) : column + INSIDE_PX + 1
                ]
                is_well = bool((around == actor.instance_id).any())
            errors.append(0.0 if is_well else 1.0)
    return Measured(worst=float(np.mean(errors)) if errors else None, tested=len(errors), total=len(errors))
