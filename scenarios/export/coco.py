"""COCO's instance and keypoint annotations (https://cocodataset.org/#format-data) of every frame."""

import shutil
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from dotmask.partial_folder import PartialFolder
from dotmask.tum import CAMERA_FILE, camera_json, colour_png
from scenarios.bridge import intrinsics_from_camera
from scenarios.export.coco_names import CATEGORY_IDS, SKELETON, supercategory
from scenarios.export.json_list import JsonList
from scenarios.export.run_lengths import counts_from_columns, text_from_counts
from sim.people.keypoints import KEYPOINT_NAMES
from sim.records import KeypointsTruth, SimFrame
from sim.simulator import Simulator

INSTANCES_FILE, KEYPOINTS_FILE = "annotations/instances.json", "annotations/person_keypoints.json"
IMAGES_PART = "images.json"

ANNOTATIONS_AN_IMAGE = 2**16
"""An annotation's id is `image id * 2**16 + instance id`: the same whatever was rendered before, and never 0."""


class CocoExport:
    """Writes `images/NNNNNN.png`, `annotations/instances.json` and `annotations/person_keypoints.json`.

    Whatever is visible and of a COCO class is annotated, furniture too. An image's id is its frame's index plus 1.
    Beside COCO's own keys an annotation has `name` and `instance_id`, and for what can move `is_moving`, `occlusion`
    and `is_truncated`.

    Args:
        folder: to fill.
        simulator: what is rendered.
        facts: what to note in `camera.json`.
    """

    def __init__(self, folder: PartialFolder, simulator: Simulator, facts: Mapping[str, object]) -> None:
        self._folder, self._camera, self._facts = folder, simulator.camera, facts
        self._annotated = [obj for obj in simulator.scene.objects if obj.instance_id and obj.class_name in CATEGORY_IDS]
        info = {"description": "rendered by dotmask: every mask is exact", "version": "1.0"}
        person = {
            **_category("person"),
            "keypoints": list(KEYPOINT_NAMES),
            "skeleton": [list(pair) for pair in SKELETON],
        }
        head = {"info": info, "licenses": []}
        self._instances = JsonList(
            folder.files,
            INSTANCES_FILE,
            {**head, "categories": [_category(name) for name in CATEGORY_IDS]},
            "annotations",
        )
        self._people = JsonList(folder.files, KEYPOINTS_FILE, {**head, "categories": [person]}, "annotations")
        self._images = JsonList(folder.parts, IMAGES_PART, {}, "images")

    def begin(self) -> None:
        """Write what is the same in all frames."""
        self._folder.files.write(CAMERA_FILE, camera_json(intrinsics_from_camera(self._camera), None, self._facts))
        for part in (self._instances, self._people, self._images):
            part.begin()

    def add(self, frame: SimFrame) -> None:
        """Append one frame."""
        image_id, name = frame.index + 1, f"{frame.index:06d}.png"
        self._folder.files.write(f"images/{name}", colour_png(frame.rgb))
        size = {"width": self._camera.width, "height": self._camera.height}
        self._images.add({"id": image_id, "file_name": name, **size, "timestamp_s": round(frame.timestamp_s, 6)})
        actors = {actor.instance_id: actor for actor in frame.truth.objects}
        columns = np.ascontiguousarray(frame.truth.instance_ids.T)
        pixels = np.bincount(columns.reshape(-1))
        for obj in self._annotated:
            if obj.instance_id >= len(pixels) or not pixels[obj.instance_id]:
                continue
            mask = columns == obj.instance_id
            top, left, height, width = cv2.boundingRect(mask.view(np.uint8))
            counts = counts_from_columns(mask.reshape(-1))
            annotation: dict[str, Any] = {
                "id": image_id * ANNOTATIONS_AN_IMAGE + obj.instance_id,
                "image_id": image_id,
                "category_id": CATEGORY_IDS[obj.class_name],
                "iscrowd": 0,
                "area": int(pixels[obj.instance_id]),
                "bbox": [left, top, width, height],
                "segmentation": {"size": [size["height"], size["width"]], "counts": text_from_counts(counts)},
                "name": obj.name,
                "instance_id": obj.instance_id,
            }
            actor = actors.get(obj.instance_id)
            if actor is not None:
                annotation["is_moving"] = actor.is_moving
                annotation["occlusion"] = round(actor.occlusion, 6)
                annotation["is_truncated"] = actor.is_truncated
            self._instances.add(annotation)
            if actor is not None and actor.keypoints is not None:
                self._people.add({**annotation, **_keypoints(actor.keypoints)})

    def finish(self) -> None:
        """Copy the list of images to the end of both files."""
        self._images.finish()
        for name in (INSTANCES_FILE, KEYPOINTS_FILE):
            # The part is `{ "images": [...]}`: without its first byte it ends a file that ended in a comma.
            with (
                self._folder.parts.path(IMAGES_PART).open("rb") as part,
                self._folder.files.path(name).open("ab") as file,
            ):
                part.seek(1)
                file.write(b"\n],")
                shutil.copyfileobj(part, file)


def _category(name: str) -> dict[str, Any]:
    number = CATEGORY_IDS[name]
    return {"id": number, "name": name, "supercategory": supercategory(number)}


def _keypoints(truth: KeypointsTruth) -> dict[str, Any]:
    """COCO's u, v, visibility of 17 points; a point outside the image is 0, 0, 0: not labelled."""
    numbers: list[float] = []
    for (u, v), visibility in zip(truth.pixels, truth.visibility, strict=True):
        numbers += [round(float(u), 3), round(float(v), 3), int(visibility)] if visibility else [0, 0, 0]
    return {"keypoints": numbers, "num_keypoints": int(np.count_nonzero(truth.visibility))}
