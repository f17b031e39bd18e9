"""The literal transcription of the paper is a second implementation: profile `paper` must believe what it believes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.literal_paper import LiteralDotMask
from dotmask.pipeline import DotMask
from dotmask.profiles import PAPER, Profile
from dotmask.records import Detections, Intrinsics, RgbdFrame

CAMERA = Intrinsics(width=160, height=120, fx=130.0, fy=128.0, cx=79.5, cy=60.5)
FRAMES, UNSEEN = 60, (20, 21, 22, 40)


def camera_pose(index: int) -> np.ndarray:
    """A camera that turns about all of its axes and moves."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler(
        "xyz", [-1.5 + 0.003 * index, 0.05 * np.sin(0.05 * index), 0.004 * index]
    ).as_matrix()
    T[:3, 3] = [0.01 * index, 0.05 * np.sin(0.1 * index), 1.2]
    return T


def recorded(class_name: str) -> list[tuple[RgbdFrame, Detections]]:
    """A block that slides, nears and changes its shape before a wall, in noise, with holes in its depth."""
    rng = np.random.default_rng(5)
    sequence = []
    for index in range(FRAMES):
        mask = np.zeros((CAMERA.height, CAMERA.width), bool)
        left, top = 20 + index, 30 + index // 4
        mask[top : top + 40, left : left + 20 + index % 7] = True
        mask[top : top + 10, left : left + index % 5] = False
        depth = np.where(mask, 2.5 - 0.01 * index, 4.0) + rng.normal(0, 0.01, mask.shape)
        depth[rng.random(mask.shape) < 0.1] = 0
        count = 0 if index in UNSEEN else 1
        detections = Detections(
            masks=mask[None][:count],
            boxes_px=np.array([[left, top, left + 19 + index % 7, top + 39]], float)[:count],
            class_names=(class_name,) * count,
            scores=np.ones(count),
        )
        frame = RgbdFrame(
            index=index,
            timestamp_s=index / 30 + 0.004 * np.sin(index),
            rgb=np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8),
            depth_m=depth.astype(np.float32),
            intrinsics=CAMERA,
        )
        sequence.append((frame, detections))
    return sequence


class Playback:
    def __init__(self, sequence: list[tuple[RgbdFrame, Detections]]) -> None:
        self._sequence = sequence

    def segment(self, frame: RgbdFrame) -> Detections:
        return self._sequence[frame.index][1]


ONLY_DEFORMATION = replace(
    PAPER, deformation_iou=0.85, classes=tuple(replace(c, speed_threshold_m_s=10.0) for c in PAPER.classes)
)


@pytest.mark.parametrize(("class_name", "profile"), [("chair", PAPER), ("person", PAPER), ("person", ONLY_DEFORMATION)])
def test_beliefs_verdicts_and_images_are_those_of_the_literal_transcription(class_name: str, profile: Profile) -> None:
    sequence = recorded(class_name)
    ours, literal = DotMask(Playback(sequence), profile), LiteralDotMask(profile)
    verdicts = set()
    for index, (frame, detections) in enumerate(sequence):
        result = ours.step(frame, camera_pose(index))
        literal.track(frame, detections, camera_pose(index))
        literal.classify()
        masked = literal.mask(frame.depth_m, detections)
        (track,), (known,) = result.tracks, literal.objects
        np.testing.assert_allclose(track.mean, known.x, rtol=0, atol=1e-6)
        np.testing.assert_allclose(track.covariance, known.P, rtol=0, atol=1e-6)
        assert track.verdict is not None
        assert track.verdict.is_moving == known.is_moving
        np.testing.assert_array_equal(result.masked.mo_mdi_m, masked.mo_mdi_m)
        np.testing.assert_array_equal(result.masked.mdi_m, masked.mdi_m)
        verdicts.add(known.is_moving)
    assert verdicts == {False, True}
