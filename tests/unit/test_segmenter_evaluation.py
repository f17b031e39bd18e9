"""The figures of a segmenter: average precision by hand, circumstances in numbers, and the oracle, who knows all."""

import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from dotmask.records import Detections
from scenarios.segmenter_evaluation.average_precision import AveragePrecision, Precision, TrueMask
from scenarios.segmenter_evaluation.report import Band
from scenarios.segmenter_evaluation.sightings import Sighting, is_reasonable, misses, sightings_of
from sim.records import CameraModel, GroundTruth, Moment, ObjectTruth, SimFrame

SIZE = (60, 100)
CAMERA = CameraModel(width=100, height=60, fx=500.0, fy=500.0, cx=49.5, cy=29.5)


def mask(left: int, width: int = 20) -> np.ndarray:
    image = np.zeros(SIZE, np.bool_)
    image[10:40, left : left + width] = True
    return image


def detections(*found: tuple[str, np.ndarray, float]) -> Detections:
    return Detections(
        masks=np.array([m for _, m, _ in found], np.bool_).reshape(-1, *SIZE),
        boxes_px=np.zeros((len(found), 4)),
        class_names=tuple(name for name, _, _ in found),
        scores=np.array([score for _, _, score in found], np.float64),
    )


def person(image: np.ndarray, *, counts: bool = True, is_reasonable: bool = True) -> TrueMask:
    return TrueMask(class_name="person", mask=image, counts=counts, is_reasonable=is_reasonable)


def precision_of(true: list[TrueMask], *found: tuple[str, np.ndarray, float]) -> tuple:
    precision = AveragePrecision(("person", "chair"))
    precision.see(SIZE, true, detections(*found))
    by_class = precision.by_class()
    assert by_class["chair"] == Precision(
        ap=None, ap50=None, ap50_reasonable=None, ap50_small=None, ap50_medium=None, ap50_large=None, reasonable=0
    )
    return by_class["person"].ap, by_class["person"].ap50


ONE, TWO = [person(mask(0))], [person(mask(0)), person(mask(50))]
HALF = 51 / 101  # precision 1 at the recalls 0, 0.01, ..., 0.5

AVERAGES = {
    "found": (precision_of(ONE, ("person", mask(0), 0.9)), (1.0, 1.0)),
    "missed": (precision_of(ONE), (0.0, 0.0)),
    "another class": (precision_of(ONE, ("cup", mask(0), 0.9)), (0.0, 0.0)),
    "one of two": (precision_of(TWO, ("person", mask(50), 0.9)), (HALF, HALF)),
    # 18 of 20 columns and 2 beyond: 18 / 22 = 0.818, enough for seven of the ten thresholds from 0.5 to 0.95
    "nearly": (precision_of(ONE, ("person", mask(2), 0.9)), (0.7, 1.0)),
    "a false one before": (precision_of(ONE, ("person", mask(0), 0.5), ("person", mask(60), 0.9)), (0.5, 0.5)),
    "a false one behind": (precision_of(ONE, ("person", mask(0), 0.5), ("person", mask(60), 0.4)), (1.0, 1.0)),
    "of the room": (
        precision_of([*ONE, person(mask(60), counts=False)], ("person", mask(0), 0.5), ("person", mask(60), 0.9)),
        (1.0, 1.0),
    ),
    "nothing to find": (precision_of([], ("person", mask(0), 0.9)), (None, None)),
}


@pytest.mark.parametrize("case", AVERAGES)
def test_average_precision_by_hand(case: str) -> None:
    told, wanted = AVERAGES[case]
    assert told == tuple(None if value is None else pytest.approx(value, abs=1e-6) for value in wanted)


def test_average_precision_by_size() -> None:
    small, medium = mask(0, 34), mask(50, 35)  # 1020 and 1050 pixels, about 32 x 32
    precision = AveragePrecision(("person",))
    precision.see(SIZE, [person(small), person(medium)], detections(("person", medium, 0.9)))
    told = precision.by_class()["person"]
    assert (told.ap50, told.ap50_medium) == pytest.approx((HALF, 1.0))
    assert (told.ap50_small, told.ap50_large) == (0.0, None)


def test_what_is_not_reasonable_is_neither_to_be_found_nor_wrong() -> None:
    precision = AveragePrecision(("person",))
    true = [person(mask(0)), person(mask(30), is_reasonable=False), person(mask(60), counts=False)]
    found = detections(("person", mask(60), 0.9), ("person", mask(30), 0.8), ("person", mask(0), 0.7))
    precision.see(SIZE, true, found)
    precision.see(SIZE, [person(mask(0), is_reasonable=False)], detections())
    told = precision.by_class()["person"]
    assert told.ap50_reasonable == pytest.approx(1.0)
    assert told.ap50 == pytest.approx(67 / 101), "two of three: precision 1 at the recalls 0, 0.01, ..., 0.66"
    assert told.reasonable == 1


@pytest.mark.parametrize(
    ("rows", "occlusion", "wanted"), [(50, 0.35, True), (49, 0.35, False), (50, 0.36, False), (0, 0.0, False)]
)
def test_what_is_reasonable(rows: int, occlusion: float, wanted: bool) -> None:
    (actor,) = seen(5).truth.objects
    image = np.zeros(SIZE, np.bool_)
    image[5 : 5 + rows, 40] = True
    assert is_reasonable(replace(actor, occlusion=occlusion), image) is wanted


@dataclass
class Sideways:
    """A simulator whose camera moves at 1 m/s to the right and holds the shutter open for 20 ms."""

    exposure_s: float = 0.02

    @property
    def sensor(self) -> SimpleNamespace:
        return SimpleNamespace(timing=SimpleNamespace(exposure_s=self.exposure_s))

    def __len__(self) -> int:
        return 11

    def time_s(self, index: int) -> float:
        return index / 10

    def moment(self, time_s: float) -> Moment:
        pose = np.eye(4)
        pose[0, 3] = time_s
        return Moment(T_world_camera=pose, palettes={})


def seen(index: int, speed_m_s: float = 0.0, pixels: int = 600, roll_deg: float = 0.0) -> SimFrame:
    """A person 2 m in front of the sideways camera; its z axis looks forward, and the world's upwards is -y of it."""
    ids = np.where(mask(0), 7, 0).astype(np.uint16)
    pose = Sideways().moment(index / 10).T_world_camera.copy()
    upright = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    angle = np.radians(roll_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    pose[:3, :3] = upright @ turn
    actor = ObjectTruth(
        name="anna",
        class_name="person",
        instance_id=7,
        T_world_object=np.eye(4),
        centre_world=np.array([index / 10, 0.0, 2.0]),
        velocity_world=np.array([speed_m_s, 0.0, 0.0]),
        surface_speed_m_s=0.0,
        is_moving=False,
        visible_pixels=pixels,
        occlusion=0.375,
        is_truncated=True,
        ideal_world=None,
    )
    truth = GroundTruth(T_world_camera=pose, depth_m=np.zeros(SIZE, np.float32), instance_ids=ids, objects=(actor,))
    return SimFrame(
        index=index,
        timestamp_s=index / 10,
        camera=CAMERA,
        rgb=np.zeros((*SIZE, 3), np.uint8),
        depth_m=np.zeros(SIZE, np.float32),
        truth=truth,
    )


def look(frame: SimFrame, found: Detections, exposure_s: float = 0.02) -> tuple[Sighting, ...]:
    return sightings_of(frame, found, ("person", "chair"), Sideways(exposure_s))


def test_circumstances_in_numbers() -> None:
    found = detections(("person", mask(2), 0.9))
    (one,) = look(seen(5, roll_deg=25.0), found)
    assert one.iou == pytest.approx(18 / 22)
    assert (one.class_name, one.is_truncated) == ("person", True)
    assert one.visible_px == seen(5).truth.objects[0].visible_pixels
    assert one.hidden_percent == 37.5
    assert one.distance_m == pytest.approx(2.0)
    assert one.tilt_deg == pytest.approx(25.0)
    assert one.blur_px == pytest.approx(500 * 0.02 / 2), "f v t / z"
    assert look(seen(5, speed_m_s=1.0), found)[0].blur_px == pytest.approx(0.0, abs=1e-9), "it moves with the camera"
    assert look(seen(0), found)[0].blur_px == pytest.approx(500 * 0.01 / 2), "before the first frame all stands still"
    assert look(seen(5), found, exposure_s=0.0)[0].blur_px == 0.0


def test_what_counts_as_missed() -> None:
    def iou(*found: tuple[str, np.ndarray, float]) -> float | None:
        return look(seen(5), detections(*found))[0].iou

    assert iou(("person", mask(0), 0.1)) == 1.0
    assert iou() is None
    assert iou(("chair", mask(0), 0.9)) is None, "found, but as something else"
    assert iou(("person", mask(9), 0.9)) is None, "11 of 29 columns"
    assert look(seen(5, pixels=79), detections()) == (), "a speck is not to be found"


def test_bands_add_up() -> None:
    def sighting(distance_m: float, *, found: bool, visible_px: int = 5000, hidden: float = 0.0) -> Sighting:
        return Sighting(
            class_name="cup",
            iou=0.8 if found else None,
            visible_px=visible_px,
            hidden_percent=hidden,
            distance_m=distance_m,
            tilt_deg=0.0,
            is_truncated=False,
            blur_px=9.0,
        )

    told = misses(
        [
            sighting(1.0, found=True),
            sighting(1.99, found=False),
            sighting(50.0, found=False, visible_px=1023, hidden=80.0),
        ]
    )
    assert told["distance_m"] == (
        Band(label="1 to 2", seen=2, missed=1, missed_share=0.5),
        Band(label="6 and more", seen=1, missed=1, missed_share=1.0),
    )
    assert [(band.label, band.missed) for band in told["visible_px"]] == [("0 to 1024", 1), ("1024 to 9216", 1)]
    assert [(band.label, band.seen) for band in told["hidden_percent"]] == [("0 to 10", 2), ("80 and more", 1)]
    assert [band.label for band in told["blur_px"]] == ["8 and more"]
    assert told["truncated"] == (Band(label="no", seen=3, missed=2, missed_share=2 / 3),)


def test_the_oracle_is_perfect_and_its_faults_are_not(dotmask) -> None:
    arguments = ("evaluate-segmenter", "oracle", "--scenarios", "smoke", "--frames", 21, "--every", 20)
    done = dotmask(*arguments, "--json")
    assert done.code == 0, done.err
    figures = json.loads(done.out)
    assert figures["segmenter"] == {"name": "oracle", "weights_sha256": None, "device": None}
    assert figures["scenarios"] == {"smoke": 2}
    for name in ("person", "chair"):
        one = figures["classes"][name]
        assert (one["ap"], one["ap50"], one["iou"], one["missed"]) == (1.0, 1.0, 1.0, 0)
        assert one["seen"] > 0
        assert (one["ap50_reasonable"], 0 < one["reasonable"] <= one["seen"]) == (1.0, True)
    assert figures["classes"]["cup"] == {
        "ap": None, "ap50": None, "ap50_reasonable": None, "ap50_small": None, "ap50_medium": None,
        "ap50_large": None, "iou": None, "seen": 0, "reasonable": 0, "missed": 0, "missed_share": None,
    }  # fmt: skip
    assert figures["ms"]["median"] is None
    done = dotmask(*arguments, "--set", "faults.borders.pixels=-3", "--every", 21)
    assert (done.code, "segmenter oracle, frames 1 of smoke" in done.out) == (0, True), done.err
    row = next(line.split() for line in done.out.splitlines() if line.strip().startswith("person"))
    assert float(row[1]) < float(row[2]) == 1.0, "AP50 forgives what AP does not"


def test_bad_input_is_one_clear_line(dotmask) -> None:
    for arguments, message in (
        (("yolact", "--scenarios", "smoke"), "--segmenter yolact: no weights come with it"),
        (("orcale", "--scenarios", "smoke"), "unknown segmenter 'orcale'. Did you mean oracle?"),
        (("oracle", "--scenarios", "smok"), "Did you mean smoke?"),
        (("oracle", "--scenarios", ","), "--scenarios ,: name at least one"),
        (("oracle", "--scenarios", "smoke", "--every", "0"), "--every 0: take at least every first frame"),
    ):
        done = dotmask("evaluate-segmenter", *arguments)
        assert (done.code, done.out) == (2, "")
        lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("evaluate")]
        assert len(lines) == 1, done.err
        assert message in lines[0]
