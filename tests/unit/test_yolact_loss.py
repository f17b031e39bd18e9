"""The loss by hand, and a network that learns one picture by heart with it."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from dotmask.evaluation.matching import mask_ious
from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.yolact.anchors import anchors_of, decode
from dotmask.segmentation.yolact.design import COMPACT
from dotmask.segmentation.yolact.images import network_image
from dotmask.segmentation.yolact.loss import IGNORED, Losses, Target, encode, match, yolact_loss
from dotmask.segmentation.yolact.network import Answer, Yolact
from dotmask.segmentation.yolact.segmenter import YolactSegmenter

torch.set_num_threads(1)
CPU = torch.device("cpu")
NOTHING = Target(boxes=torch.zeros(0, 4), classes=torch.zeros(0, dtype=torch.int64), masks=torch.zeros(0, 8, 8))


def test_encoding_is_decoding_backwards() -> None:
    generator = torch.Generator().manual_seed(0)
    offsets, anchors = torch.randn(40, 4, generator=generator), torch.rand(40, 4, generator=generator) + 0.1
    torch.testing.assert_close(encode(decode(offsets, anchors), anchors), offsets, atol=1e-4, rtol=0)


def anchor(x1: float, y1: float, x2: float, y2: float) -> list[float]:
    return [(x1 + x2) / 2, (y1 + y2) / 2, x2 - x1, y2 - y1]


def test_matching_by_hand() -> None:
    target = Target(
        boxes=torch.tensor([[0.0, 0.0, 0.4, 0.4], [0.6, 0.6, 1.0, 1.0]]),
        classes=torch.tensor([3, 1]),
        masks=torch.zeros(2, 8, 8),
    )
    anchors = torch.tensor(
        [
            anchor(0.0, 0.0, 0.4, 0.4),  # IoU 1 with the first
            anchor(0.0, 0.0, 0.4, 0.18),  # 0.45
            anchor(0.0, 0.0, 0.4, 0.14),  # 0.35
            anchor(0.0, 0.0, 0.4, 0.08),  # 0.2
            anchor(0.5, 0.5, 0.7, 0.7),  # 0.01 / 0.19 with the second, and nobody has more
        ]
    )
    box, told = match(anchors, target)
    assert told.tolist() == [4, 4, IGNORED, 0, 2]
    assert box[[0, 1, 4]].tolist() == [0, 0, 1]
    assert match(anchors, NOTHING)[1].tolist() == [0] * 5


def test_two_boxes_with_one_best_anchor_both_get_one() -> None:
    target = Target(
        boxes=torch.tensor([[0.0, 0.0, 0.4, 0.4], [0.0, 0.0, 0.4, 0.39]]),
        classes=torch.tensor([0, 1]),
        masks=torch.zeros(2, 8, 8),
    )
    box, told = match(torch.tensor([anchor(0, 0, 0.4, 0.4), anchor(0.8, 0.8, 1, 1)]), target)
    assert (box.tolist(), told.tolist()) == ([0, 1], [1, 2])


def answer_of(anchors: Tensor, seed: int) -> Answer:
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator)

    count = len(anchors)
    return Answer(
        draw(1, count, 4), draw(1, count, 5), torch.tanh(draw(1, count, 6)), draw(1, 12, 16, 6).relu(), draw(1, 4, 6, 8)
    )


def test_the_loss_by_slow_sums() -> None:
    anchors = anchors_of(replace(COMPACT, height=48, width=64))
    masks = torch.zeros(2, 24, 32)
    masks[0, 4:16, 2:14] = 1
    masks[1, 9:22, 15:30] = 1  # at this edge a pixel of the prototypes holds half a pixel of the mask
    boxes = torch.tensor([[2 / 32, 4 / 24, 14 / 32, 16 / 24], [16 / 32, 8 / 24, 30 / 32, 22 / 24]])
    target = Target(boxes=boxes, classes=torch.tensor([2, 0]), masks=masks)
    answer = answer_of(anchors, 1)
    told = yolact_loss(answer, [target], anchors)

    box, classes = match(anchors, target)
    probabilities = torch.softmax(answer.logits[0], dim=1)
    positives = [i for i, c in enumerate(classes.tolist()) if c > 0]
    likelihoods = [probabilities[i, c].item() for i, c in enumerate(classes.tolist()) if c != IGNORED]
    assert len(anchors) > len(likelihoods) > 3 * len(positives) > 3
    of_classes = sum(-((1 - likelihood) ** 2) * math.log(likelihood) for likelihood in likelihoods)
    of_boxes = of_masks = 0.0
    small = (masks[:, ::2, ::2] + masks[:, 1::2, ::2] + masks[:, ::2, 1::2] + masks[:, 1::2, 1::2]) / 4
    for i in positives:
        for difference in (answer.offsets[0, i] - encode(boxes[box[i]], anchors[i])).abs().tolist():
            of_boxes += difference - 0.5 if difference > 1 else difference**2 / 2
        x1, y1, x2, y2 = (boxes[box[i]] * torch.tensor([16, 12, 16, 12])).tolist()
        total, pixels = 0.0, 0
        for v in range(12):
            for u in range(16):
                if y1 - 1 <= v < y2 + 1 and x1 - 1 <= u < x2 + 1:
                    pixels += 1
                    share = torch.sigmoid(answer.prototypes[0, v, u] @ answer.coefficients[0, i]).item()
                    held = small[box[i], v, u].item()
                    total -= held * math.log(share) + (1 - held) * math.log(1 - share)
        of_masks += total / pixels
    wanted = torch.zeros(4, 6, 8)
    for number, mask in ((2, masks[0]), (0, masks[1])):
        wanted[number] = mask[1::4, 1::4] + mask[2::4, 1::4] + mask[1::4, 2::4] + mask[2::4, 2::4] > 2
    share = torch.sigmoid(answer.semantic[0])
    of_semantic = -(wanted * share.log() + (1 - wanted) * (1 - share).log()).sum() / 48
    count = len(positives)
    assert [part.item() for part in told] == pytest.approx(
        [of_classes / count, 1.5 * of_boxes / count, 6.125 * of_masks / count, of_semantic.item()], rel=1e-4
    )


def test_an_image_without_objects_costs_what_is_found_in_it() -> None:
    anchors = anchors_of(replace(COMPACT, height=48, width=64))
    answer = answer_of(anchors, 2)
    told = yolact_loss(answer, [NOTHING], anchors)
    assert (told.boxes.item(), told.masks.item()) == (0.0, 0.0)
    assert told.semantic.item() > 0
    background = torch.softmax(answer.logits[0], dim=1)[:, 0].tolist()
    of_classes = sum(-((1 - likelihood) ** 2) * math.log(likelihood) for likelihood in background)
    assert told.classes.item() == pytest.approx(of_classes, rel=1e-4)


def test_a_small_network_learns_one_picture_by_heart() -> None:
    design = replace(
        COMPACT, height=64, width=96, channels=32, prototypes=8, scales_px=((12.0,), (24.0,), (40.0,), (64.0,), (90.0,))
    )
    rng = np.random.default_rng(3)
    rgb = rng.integers(0, 80, (64, 96, 3), dtype=np.uint8)
    v, u = np.mgrid[:64, :96]
    disc, bar = (u - 28) ** 2 + (v - 30) ** 2 < 18**2, (abs(u - 72) < 8) & (abs(v - 34) < 24)
    rgb[disc], rgb[bar] = (220, 60, 60), (60, 60, 230)
    target = Target(
        boxes=torch.tensor([[11 / 96, 13 / 64, 46 / 96, 48 / 64], [65 / 96, 11 / 64, 80 / 96, 58 / 64]]),
        classes=torch.tensor([1, 0]),
        masks=torch.from_numpy(np.stack([disc, bar])).float(),
    )
    torch.manual_seed(0)
    network, anchors = Yolact(design), anchors_of(design)
    camera = Intrinsics(width=96, height=64, fx=90.0, fy=90.0, cx=47.5, cy=31.5)
    frame = RgbdFrame(index=0, timestamp_s=0.0, rgb=rgb, depth_m=np.ones((64, 96), np.float32), intrinsics=camera)
    images = network_image(frame, design, CPU).repeat(2, 1, 1, 1)
    optimiser = torch.optim.Adam(network.parameters(), lr=2e-3)
    history: list[Losses] = []
    for _ in range(60):
        losses = yolact_loss(network.train()(images), [target, target], anchors)
        optimiser.zero_grad()
        sum(losses).backward()
        optimiser.step()
        history.append(Losses(*(part.detach() for part in losses)))
    for first, last in zip(history[0], history[-1], strict=True):
        assert last < 0.5 * first, (history[0], history[-1])
    found = YolactSegmenter(network, design, CPU).segment(frame)
    assert found.class_names[:2] in (("chair", "person"), ("person", "chair"))
    ious = mask_ious(found.masks, np.where(disc, 1, np.where(bar, 2, 0)).astype(np.uint16))
    for name, iou in zip(found.class_names[:2], ious, strict=False):
        assert iou[1 if name == "chair" else 2] > 0.8, ious
