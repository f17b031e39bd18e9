"""Command line: `python -m tools.train_vocabulary [--out assets]`, from the root of the repository."""

import argparse
from pathlib import Path

import cv2
import numpy as np

from dotmask.records import Intrinsics
from dotmask.slam.features import Descriptors, FeatureExtractor
from dotmask.slam.settings import OdometrySettings
from dotmask.slam.vocabulary import FILE, Vocabulary
from sim.records import CameraModel, Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from sim.scene import Scene
from sim.sensor.parameters import KINECT_V1
from tools.asset_files import update_manifest, write_npz
from tools.train_vocabulary.clusters import tree
from tools.train_vocabulary.rooms import random_room, random_views

SEED = 20200926
ROOMS, VIEWS = 40, 10
BRANCHES, DEPTH = 12, 3
CAMERA = CameraModel(width=640, height=480, fx=535.4, fy=539.2, cx=320.1, cy=247.6)
SOURCE = "made by tools/train_vocabulary"
LICENCE = "CC0-1.0"
CHANGES = (
    f"tree of {BRANCHES}^{DEPTH} binary words by k-majority on the ORB descriptors of {ROOMS * VIEWS} rendered images "
    "of random rooms, none of which is in a scenario"
)


def descriptors_of_room(number: int) -> list[Descriptors]:
    """The descriptors of each of the views of a room."""
    room = random_room(number, SEED)
    renderer = VisibilityBufferRenderer(Scene(objects=room.objects, lights=room.lights), CAMERA)
    intrinsics = Intrinsics(
        width=CAMERA.width, height=CAMERA.height, fx=CAMERA.fx, fy=CAMERA.fy, cx=CAMERA.cx, cy=CAMERA.cy
    )
    extractor = FeatureExtractor(intrinsics, OdometrySettings())
    found = []
    for view, T_world_camera in enumerate(random_views(number, SEED, VIEWS)):
        images = renderer.render(
            Moment(T_world_camera=T_world_camera, palettes={}), normals=KINECT_V1.model.needs_normals
        )
        rgb, depth_m = KINECT_V1.model.measure(images, CAMERA, SEED, number * VIEWS + view)
        grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        found.append(extractor.extract(grey, depth_m).descriptors)
    return found


def main() -> None:
    """Render, cluster, weigh and write."""
    parser = argparse.ArgumentParser(prog="python -m tools.train_vocabulary", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("assets"), help="the asset folder (default: assets)")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    images = [found for number in range(ROOMS) for found in descriptors_of_room(number)]
    levels = tree(np.concatenate(images), BRANCHES, DEPTH, np.random.default_rng(SEED))
    unweighted = Vocabulary(levels=tuple(levels), idf=np.ones(len(levels[-1]), np.float32))
    seen = np.zeros(len(unweighted), np.int64)
    for found in images:
        seen[np.unique(unweighted.words_of(found))] += 1
    # A word that no image showed tells as much as one that a single image showed.
    idf = np.log(len(images) / np.maximum(seen, 1)).astype(np.float32)
    arrays = {f"level_{depth}": nodes for depth, nodes in enumerate(levels)}
    write_npz(args.out / FILE, {**arrays, "idf": idf})
    update_manifest(args.out, FILE, source=SOURCE, licence=LICENCE, changes=CHANGES)
    print(
        f"{sum(len(found) for found in images)} descriptors of {len(images)} images, {(seen > 0).sum()} words seen, "
        f"{(args.out / FILE).stat().st_size / 1e3:.0f} kB"
    )


if __name__ == "__main__":
    main()
