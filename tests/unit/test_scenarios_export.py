"""The formats of `dotmask render`, on frames made by hand."""

import csv
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from scipy.spatial.transform import Rotation

from dotmask.partial_folder import GrowingFiles, PartialFolder
from dotmask.tum import read_camera, read_sequence, read_trajectory
from scenarios.export.coco import CocoExport
from scenarios.export.coco_names import CATEGORY_IDS, SKELETON, supercategory
from scenarios.export.json_list import JsonList
from scenarios.export.kitti import KittiExport
from scenarios.export.run_lengths import counts_from_columns, text_from_counts
from scenarios.export.truth import OBJECT_COLUMNS, TruthFiles, decimal
from scenarios.export.tum import TumExport
from scenarios.spec import Scenario, scenario_from_json
from sim.people.keypoints import KEYPOINT_NAMES
from sim.records import CameraModel, GroundTruth, KeypointsTruth, ObjectTruth, SimFrame

# pycocotools' arrays are of the time before numpy 2, which numpy tells at every use.
pytestmark = pytest.mark.filterwarnings("ignore:__array:DeprecationWarning")

CAMERA = CameraModel(width=12, height=9, fx=10.0, fy=11.0, cx=5.5, cy=4.25)
PERSON, CHAIR, CUP, BOX = 1, 51, 108, 130
SCENARIO = Scenario(name="made_by_hand", description="-", frames=3)


def pose(index: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [-100 + index, 3, 20 * index], degrees=True).as_matrix()
    T[:3, 3] = [0.1 * index, 1 - 0.2 * index, 1.5]
    return T


def keypoints() -> KeypointsTruth:
    pixels = np.array([[k * 0.7, 8 - 0.4 * k] for k in range(17)])
    visibility = np.array([2, 1] * 8 + [0], np.uint8)
    pixels[16] = np.nan
    return KeypointsTruth(world_m=np.arange(51.0).reshape(17, 3) / 7, pixels=pixels, visibility=visibility)


def actor(name: str, class_name: str, instance_id: int, ids: np.ndarray, index: int) -> ObjectTruth:
    return ObjectTruth(
        name=name,
        class_name=class_name,
        instance_id=instance_id,
        T_world_object=pose(index + 1),
        centre_world=np.array([1.0, 2.0, 3.0 + index]),
        velocity_world=np.array([0.25, -1e-9, -0.5]),
        surface_speed_m_s=0.75,
        is_moving=True,
        visible_pixels=int((ids == instance_id).sum()),
        occlusion=0.125,
        is_truncated=False,
        ideal_world=None,
        keypoints=keypoints() if class_name == "person" else None,
    )


def frame(index: int) -> SimFrame:
    rng = np.random.default_rng(index)
    ids = rng.choice([0, 0, PERSON, CHAIR, CUP, BOX], (9, 12)).astype(np.uint16)
    ids[0, 0] = PERSON if index == 0 else 0  # a mask that begins with 1, and masks that begin with 0
    if index == 2:
        ids[ids == PERSON] = 0  # out of view
    depth = rng.uniform(0.5, 9.0, (9, 12)).astype(np.float32)
    depth[0, :2] = 0.0, 20.0
    return SimFrame(
        index=index,
        timestamp_s=index / 30,
        camera=CAMERA,
        rgb=rng.integers(0, 256, (9, 12, 3), dtype=np.uint8),
        depth_m=depth,
        truth=GroundTruth(
            T_world_camera=pose(index),
            depth_m=depth,
            instance_ids=ids,
            objects=(actor("anton", "person", PERSON, ids, index), actor("chair", "chair", CHAIR, ids, index)),
        ),
    )


def simulator() -> Any:
    objects = [
        SimpleNamespace(name=name, class_name=class_name, instance_id=number)
        for name, class_name, number in (
            ("wall", "wall", 0),
            ("anton", "person", PERSON),
            ("chair", "chair", CHAIR),
            ("cup a", "cup", CUP),
            ("carton", "box", BOX),
        )
    ]
    return SimpleNamespace(camera=CAMERA, scene=SimpleNamespace(objects=objects, actors=objects[1:3]), frame=frame)


def write(kind: Any, out: Path) -> Path:
    folder = PartialFolder.create(out, {})
    exports = [kind(folder, simulator(), {"sensor": {"model": "ideal"}}), TruthFiles(folder.files, SCENARIO)]
    for export in exports:
        export.begin()
    for index in range(3):
        for export in exports:
            export.add(frame(index))
        folder.commit()
    for export in exports:
        export.finish()
    folder.finish()
    return out


@pytest.mark.parametrize("seed", range(20))
def test_run_lengths_are_those_of_pycocotools(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 90, 2))
    mask = rng.random(shape) < rng.choice([0.0, 0.02, 0.5, 0.98, 1.0])
    if seed % 2:
        mask = cv2.blur(mask.astype(np.float32), (9, 9)) > 0.5  # long runs, as real masks have
    counts = counts_from_columns(mask.T.reshape(-1))
    assert counts.sum() == mask.size
    text = text_from_counts(counts)
    assert text == coco_mask.encode(np.asfortranarray(mask.view(np.uint8)))["counts"].decode()
    np.testing.assert_array_equal(coco_mask.decode({"size": list(shape), "counts": text}), mask)


def test_run_lengths_of_a_large_image_fit() -> None:
    counts = np.array([0, 1, 2_000_000_000, 5, 1], np.int64)
    text = text_from_counts(counts)
    plain = coco_mask.frPyObjects({"size": [1, int(counts.sum())], "counts": counts.tolist()}, 1, int(counts.sum()))
    assert text == plain["counts"].decode()


def test_a_json_list_grows_item_by_item(tmp_path: Path) -> None:
    files = GrowingFiles(tmp_path)
    for name, items in (("none.json", []), ("one.json", [1]), ("more.json", [{"a": "ü"}, [1, 2], None])):
        growing = JsonList(files, name, {"head": [1, {"x": "y"}], "text": "z"}, "items")
        growing.begin()
        for item in items:
            growing.add(item)
        growing.finish()
        assert json.loads((tmp_path / name).read_text()) == {"head": [1, {"x": "y"}], "text": "z", "items": items}
    with pytest.raises(ValueError, match="JSON compliant"):
        growing.add(math.nan)


def test_tum_folder(tmp_path: Path) -> None:
    root = write(TumExport, tmp_path / "out")
    assert sorted(p.name for p in root.iterdir()) == [
        "associations.txt", "camera.json", "depth", "depth.txt", "groundtruth.txt", "instance", "instance.txt",
        "keypoints.json", "objects.csv", "rgb", "rgb.txt", "scenario.json",
    ]  # fmt: skip
    for index, back in enumerate(read_sequence(root)):
        np.testing.assert_array_equal(back.rgb, frame(index).rgb)
        wanted = np.where(frame(index).depth_m > 13.107, 0, frame(index).depth_m)
        np.testing.assert_allclose(back.depth_m, wanted, atol=1.01e-4)
        stamp = f"{index / 30:.6f}"
        ids = cv2.imread(str(root / "instance" / f"{stamp}.png"), cv2.IMREAD_UNCHANGED)
        assert ids.dtype == np.uint16
        np.testing.assert_array_equal(ids, frame(index).truth.instance_ids)
    assert (root / "instance.txt").read_text().splitlines()[1] == "0.000000 instance/0.000000.png"
    truth = read_trajectory(root / "groundtruth.txt")
    np.testing.assert_allclose(truth.T_world_camera, [pose(k) for k in range(3)], atol=1e-12)
    assert read_camera(root / "camera.json").intrinsics.fy == 11.0
    camera = json.loads((root / "camera.json").read_text())
    assert camera["depth_per_metre"] == 5000
    assert camera["sensor"] == {"model": "ideal"}
    assert scenario_from_json((root / "scenario.json").read_text(), "-") == SCENARIO


def test_objects_and_keypoints(tmp_path: Path) -> None:
    root = write(TumExport, tmp_path / "out")
    with (root / "objects.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == OBJECT_COLUMNS
    assert [(row["timestamp_s"], row["name"]) for row in rows[2:4]] == [("0.033333", "anton"), ("0.033333", "chair")]
    first = rows[0]
    assert [float(first[f"t{axis}"]) for axis in "xyz"] == pytest.approx(pose(1)[:3, 3])
    quaternion = [float(first[f"q{axis}"]) for axis in "xyzw"]
    np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), pose(1)[:3, :3], atol=1e-8)
    assert (first["velocity_x_m_s"], first["velocity_y_m_s"]) == ("0.250000", "0.000000")
    assert (first["is_moving"], first["occlusion"], first["is_truncated"]) == ("1", "0.125000", "0")
    assert int(first["visible_pixels"]) == (frame(0).truth.instance_ids == PERSON).sum()

    told = json.loads((root / "keypoints.json").read_text())
    assert tuple(told["keypoints"]) == KEYPOINT_NAMES
    assert len(told["frames"]) == 3
    (person,) = told["frames"][1]["people"]
    assert (person["name"], person["instance_id"]) == ("anton", PERSON)
    np.testing.assert_allclose(person["world_m"], keypoints().world_m, atol=1e-6)
    assert person["pixels"][16] is None, "behind the camera there is no pixel, and NaN is no JSON"
    np.testing.assert_allclose(person["pixels"][:16], keypoints().pixels[:16], atol=1e-3)
    assert person["visibility"] == keypoints().visibility.tolist()


def test_decimals_have_no_negative_zero() -> None:
    assert [decimal(x) for x in (-1e-9, 0.0, -0.5, 1 / 3)] == ["0.000000", "0.000000", "-0.500000", "0.333333"]


def test_coco_folder_is_loaded_by_pycocotools(tmp_path: Path) -> None:
    root = write(CocoExport, tmp_path / "out")
    coco = COCO(str(root / "annotations" / "instances.json"))
    assert len(coco.getImgIds()) == 3
    assert {c["name"]: c["id"] for c in coco.loadCats(coco.getCatIds())} == CATEGORY_IDS
    for index in range(3):
        one = frame(index)
        (image,) = coco.loadImgs([index + 1])
        stored = cv2.imread(str(root / "images" / image["file_name"]))
        np.testing.assert_array_equal(stored[..., ::-1], one.rgb)
        assert (image["width"], image["height"]) == (12, 9)
        annotations = coco.loadAnns(coco.getAnnIds(imgIds=[index + 1]))
        ids = one.truth.instance_ids
        assert {a["instance_id"] for a in annotations} == set(np.unique(ids).tolist()) - {0, BOX}, "a box is no class"
        for annotation in annotations:
            mask = ids == annotation["instance_id"]
            np.testing.assert_array_equal(coco.annToMask(annotation), mask)
            v, u = np.nonzero(mask)
            assert annotation["bbox"] == [u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1]
            assert annotation["bbox"] == coco_mask.toBbox(coco.annToRLE(annotation)).tolist()
            assert annotation["area"] == mask.sum()
            assert annotation["iscrowd"] == 0
            assert ("is_moving" in annotation) == (annotation["instance_id"] in (PERSON, CHAIR))
    assert {a["category_id"] for a in coco.anns.values()} == {1, 62, 47}

    people = COCO(str(root / "annotations" / "person_keypoints.json"))
    assert len(people.getImgIds()) == 3
    assert len(people.anns) == 2, "in the third frame nobody is visible"
    annotation = people.loadAnns(people.getAnnIds(imgIds=[1]))[0]
    assert annotation["num_keypoints"] == 16
    points = np.array(annotation["keypoints"]).reshape(17, 3)
    np.testing.assert_array_equal(points[:, 2], keypoints().visibility)
    np.testing.assert_allclose(points[:16, :2], keypoints().pixels[:16], atol=1e-3)
    np.testing.assert_array_equal(points[16], 0)
    (person,) = people.loadCats(people.getCatIds())
    assert person["keypoints"] == list(KEYPOINT_NAMES)


def test_the_skeleton_and_the_groups_are_complete() -> None:
    assert {n for pair in SKELETON for n in pair} == set(range(1, 18))
    groups = {name: supercategory(number) for name, number in CATEGORY_IDS.items()}
    assert (groups["person"], groups["chair"], groups["tv"], groups["cup"]) == (
        "person", "furniture", "electronic", "kitchen",
    )  # fmt: skip


def test_kitti_folder(tmp_path: Path) -> None:
    root = write(KittiExport, tmp_path / "out")
    sequence = root / "sequences" / "00"
    poses = np.loadtxt(root / "poses" / "00.txt").reshape(3, 3, 4)
    np.testing.assert_array_equal(poses[0], np.eye(4)[:3])
    for index in range(3):
        # A point of camera `index`, in the first camera, by way of the world.
        point = np.array([0.3, -0.2, 2.0, 1.0])
        first = np.linalg.solve(pose(0), pose(index) @ point)
        np.testing.assert_allclose(poses[index] @ point, first[:3], atol=1e-8)
        depth = cv2.imread(str(sequence / "depth" / f"{index:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert depth.dtype == np.uint16
        np.testing.assert_array_equal(depth, np.rint(frame(index).depth_m.astype(float) * 256))
        bgr = cv2.imread(str(sequence / "image_2" / f"{index:06d}.png"))
        np.testing.assert_array_equal(bgr[..., ::-1], frame(index).rgb)
        ids = cv2.imread(str(sequence / "instance" / f"{index:06d}.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(ids, frame(index).truth.instance_ids)
    np.testing.assert_allclose(np.loadtxt(sequence / "times.txt"), np.arange(3) / 30, atol=1e-7)
    lines = (sequence / "calib.txt").read_text().splitlines()
    assert [line[:3] for line in lines] == ["P0:", "P1:", "P2:", "P3:"]
    P = np.array(lines[2].split()[1:], float).reshape(3, 4)
    np.testing.assert_array_equal(P, [[10, 0, 5.5, 0], [0, 11, 4.25, 0], [0, 0, 1, 0]])
    assert json.loads((root / "camera.json").read_text())["depth_per_metre"] == 256
