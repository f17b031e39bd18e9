"""Do detectors that were trained on photographs find the rendered people?

    python -m tools.check_detectors render DIR     # with the project's environment
    python -m tools.check_detectors detect DIR     # with the detectors' environment, see tools/README.md

Every character walks in every outfit through the office, seen from 1.2 to 6 m by a still camera with the noise of the
default sensor. The detectors are MediaPipe's BlazePose (landmarks and person mask) and face detector, and OpenCV's HOG
detector of Dalal and Triggs (CVPR 2005). The second step writes the tables in `docs/people.md`, by character and outfit
and by distance.
"""

import argparse
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tools.doc_block import markdown_table, write_block

PEOPLE = Path(__file__).parent.parent / "docs" / "people.md"
FRAMES = 28
FRAME_RATE_HZ = 2.4
WAY = ((-1.9, -2.5), (2.6, -2.6), (2.6, -1.5), (-1.9, -1.6))
CAMERA_M = (-3.2, -2.05, 1.4)
MIN_HEIGHT_PX = 120
FACE_TURN_DEG = 55
"""A face that is turned away further than this is not counted."""
HOG_PERSON = (0.5, 0.8)
"""Share of the width and height of a HOG window that the person fills."""
HOG_OVERLAP = 0.4
"""Smallest IoU of boxes that counts as found."""
BLAZE_OF_COCO = (0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28)
"""Which of BlazePose's 33 landmarks is each of COCO's 17 keypoints."""
BANDS_M = (0.0, 2.0, 3.0, 4.0, 7.0)


def render(folder: Path) -> None:
    """Write the frames, their masks, and `frames.json` with what is true about them."""
    from scenarios.spec import CameraSpec, PeopleSpec, PersonSpec, Scenario, WalkLoopAct
    from scenarios.world import build_simulator
    from sim.people.characters import CHARACTERS, load_character, skin

    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for character, outfits in CHARACTERS.items():
        for outfit in outfits:
            walk = WalkLoopAct(waypoints_m=WAY[1:], speed_m_s=1.0)
            person = PersonSpec(name="walker", character=character, outfit=outfit, position_m=WAY[0], acts=(walk,))
            scenario = Scenario(
                name="detectors",
                description="One person walks.",
                frames=FRAMES,
                frame_rate_hz=FRAME_RATE_HZ,
                camera=CameraSpec(path="static", position_m=CAMERA_M, heading_deg=0.0, amplitude=0.0),
                people=PeopleSpec(cast=(person,)),
            )
            simulator = build_simulator(scenario, "numba", 2)
            rig = load_character(character, outfit).keypoints
            for index in range(FRAMES):
                frame = simulator.frame(index)
                moment = simulator.moment(simulator.time_s(index))
                mask = frame.truth.instance_ids == frame.truth.objects[0].instance_id
                if not mask.any() or np.ptp(np.flatnonzero(mask.any(1))) + 1 < MIN_HEIGHT_PX:
                    continue
                world = skin(rig.points, rig.bones, rig.weights, moment.palettes["walker"])
                R, t = moment.T_world_camera[:3, :3], moment.T_world_camera[:3, 3]
                seen = (world - t) @ R
                camera = frame.camera
                pixels = seen[:, :2] / seen[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
                ahead, to_camera = seen[0] - seen[3:5].mean(0), -seen[0]
                turn = np.degrees(np.arccos(ahead @ to_camera / (np.linalg.norm(ahead) * np.linalg.norm(to_camera))))
                name = f"{character}-{outfit}-{index:02d}"
                cv2.imwrite(str(folder / f"{name}.png"), frame.rgb[..., ::-1])
                cv2.imwrite(str(folder / f"{name}-mask.png"), mask.astype(np.uint8) * 255)
                rows.append(
                    {
                        "name": name,
                        "who": f"{character} {outfit}",
                        "distance_m": float(seen[11:13, 2].mean()),
                        "turn_deg": float(turn),
                        "keypoints_px": pixels.round(2).tolist(),
                    }
                )
    (folder / "frames.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"{len(rows)} frames in {folder}")


def detect(folder: Path) -> None:
    """Run the detectors over the frames of `render` and print the tables."""
    import mediapipe

    pose = mediapipe.solutions.pose.Pose(static_image_mode=True, model_complexity=1, enable_segmentation=True)
    faces = mediapipe.solutions.face_detection.FaceDetection(model_selection=0, min_detection_confidence=0.5)
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(hog.getDefaultPeopleDetector())
    by_outfit: dict[str, list[dict[str, float]]] = defaultdict(list)
    by_distance: dict[str, list[dict[str, float]]] = defaultdict(list)
    for row in json.loads((folder / "frames.json").read_text(encoding="utf-8")):
        image = cv2.imread(str(folder / f"{row['name']}.png"))
        mask = cv2.imread(str(folder / f"{row['name']}-mask.png"), cv2.IMREAD_GRAYSCALE) > 127
        result = _scores(image, mask, row, pose, faces, hog)
        by_outfit[row["who"]].append(result)
        band = int(np.searchsorted(BANDS_M, row["distance_m"])) - 1
        by_distance[f"{BANDS_M[band]:g} to {BANDS_M[band + 1]:g} m"].append(result)
    tables = _table("character and outfit", by_outfit), _table("distance", dict(sorted(by_distance.items())))
    write_block(PEOPLE, "detectors", "python -m tools.check_detectors detect DIR", "\n\n".join(tables))
    print("\n\n".join(tables))


def _scores(image: Any, mask: Any, row: dict[str, Any], pose: Any, faces: Any, hog: Any) -> dict[str, float]:
    """What each detector makes of one frame; a figure that does not apply is left out."""
    rgb = np.ascontiguousarray(image[..., ::-1])
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    box = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)
    truth = np.array(row["keypoints_px"])
    scores: dict[str, float] = {}

    found = pose.process(rgb)
    scores["pose"] = float(found.pose_landmarks is not None)
    if found.pose_landmarks is not None:
        person = found.segmentation_mask > 0.5
        scores["mask IoU"] = float((person & mask).sum() / (person | mask).sum())
        marks = np.array([(m.x * width, m.y * height) for m in found.pose_landmarks.landmark])[list(BLAZE_OF_COCO)]
        inside = ((truth >= 0) & (truth < (width, height))).all(1)
        error = np.linalg.norm(marks - truth, axis=1)[inside] / (box[3] - box[1])
        scores["keypoints off"] = 100 * float(np.median(error))

    is_whole = rows[0] > 2 and rows[-1] < height - 3 and columns[0] > 2 and columns[-1] < width - 3
    if is_whole:
        windows, _ = hog.detectMultiScale(image, winStride=(8, 8), padding=(16, 16), scale=1.05)
        scores["HOG"] = float(any(_overlap(_shrunk(w), box) > HOG_OVERLAP for w in windows))

    if row["turn_deg"] < FACE_TURN_DEG:
        middle, size = truth[:5].mean(0), 5 * np.ptp(truth[:5], axis=0).max()
        size = max(size, 0.28 * (truth[15:].mean(0) - truth[0])[1])
        x0, y0 = np.maximum((middle - size / 2).astype(int), 0)
        x1, y1 = np.minimum((middle + size / 2).astype(int), (width, height))
        if y1 - y0 > 16 and x1 - x0 > 16:
            crop = cv2.resize(rgb[y0:y1, x0:x1], (256, 256), interpolation=cv2.INTER_CUBIC)
            scores["face"] = float(bool(faces.process(crop).detections))
    return scores


def _shrunk(window: Any) -> Any:
    """The box of the person in a HOG window (x, y, width, height)."""
    x, y, w, h = window
    return np.array(
        [
            x + w * (1 - HOG_PERSON[0]) / 2,
            y + h * (1 - HOG_PERSON[1]) / 2,
            x + w * (1 + HOG_PERSON[0]) / 2,
            y + h * (1 + HOG_PERSON[1]) / 2,
        ]
    )


def _overlap(a: Any, b: Any) -> float:
    """IoU of two boxes (left, top, right, bottom)."""
    size = np.clip(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0, None)
    common = size.prod()
    return float(common / ((a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod() - common))


def _table(heading: str, groups: dict[str, list[dict[str, float]]]) -> str:
    """How many frames each detector found of those that count, and mean figures."""
    rows = []
    for name, results in groups.items():

        def share(key: str, results: list[dict[str, float]] = results) -> str:
            hits = [r[key] for r in results if key in r]
            return f"{int(sum(hits))}/{len(hits)}"

        iou = [r["mask IoU"] for r in results if "mask IoU" in r] or [0.0]
        off = [r["keypoints off"] for r in results if "keypoints off" in r] or [float("nan")]
        masks = f"{np.mean(iou):.3f} ({min(iou):.2f})"
        rows.append([name, share("pose"), masks, f"{np.mean(off):.1f}", share("HOG"), share("face")])
    return markdown_table([heading, "BlazePose", "mask IoU (least)", "keypoints off, %", "HOG", "face"], rows)


def main() -> None:
    """Read the arguments and run one of the two steps."""
    parser = argparse.ArgumentParser(prog="python -m tools.check_detectors", description=__doc__.splitlines()[0])
    parser.add_argument("step", choices=("render", "detect"))
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    {"render": render, "detect": detect}[args.step](args.folder)


if __name__ == "__main__":
    main()
