"""The parts of YOLACT that have a closed form, against slow implementations of the definitions."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.yolact.anchors import anchors_of, decode
from dotmask.segmentation.yolact.deformable import DeformableConv2d, deformable_conv2d
from dotmask.segmentation.yolact.design import COMPACT, YOLACT, YOLACT_PLUS, YolactDesign
from dotmask.segmentation.yolact.fast_nms import fast_nms
from dotmask.segmentation.yolact.images import depth_channel, network_image, stretched
from dotmask.segmentation.yolact.mask_kernels import certainties, stretched_above
from dotmask.segmentation.yolact.masks import assemble

torch.set_num_threads(1)
CPU = torch.device("cpu")
SIZES = {
    "yolact": ((69, 69), (35, 35), (18, 18), (9, 9), (5, 5)),
    "compact": ((30, 40), (15, 20), (8, 10), (4, 5), (2, 3)),
}


def slow_anchors(design: YolactDesign, sizes: tuple[tuple[int, int], ...], square: bool) -> list[list[float]]:
    rows = []
    for (height, width), scales in zip(sizes, design.scales_px, strict=True):
        for v, u, scale, ratio in itertools.product(range(height), range(width), scales, design.aspect_ratios):
            w = scale * math.sqrt(ratio) / design.width
            h = w if square else scale / math.sqrt(ratio) / design.height
            rows.append([(u + 0.5) / width, (v + 0.5) / height, w, h])
    return rows


@pytest.mark.parametrize(
    ("design", "sizes", "square", "count"),
    [
        (YOLACT, SIZES["yolact"], True, 19248),
        (YOLACT_PLUS, SIZES["yolact"], False, 57744),
        (COMPACT, SIZES["compact"], False, 9636),
    ],
    ids=["yolact", "yolact++", "compact"],
)
def test_anchors(design: YolactDesign, sizes: tuple[tuple[int, int], ...], square: bool, count: int) -> None:
    anchors = anchors_of(design)
    assert anchors.shape == (count, 4)
    np.testing.assert_allclose(anchors, slow_anchors(design, sizes, square), atol=1e-6)


def test_the_first_anchors_in_numbers() -> None:
    assert anchors_of(YOLACT)[:3, 2:].mul(550).tolist() == [
        pytest.approx([24, 24]),
        pytest.approx([24 / 2**0.5] * 2),
        pytest.approx([24 * 2**0.5] * 2),
    ]
    assert anchors_of(YOLACT_PLUS)[4, 2:].mul(550).tolist() == pytest.approx(
        [24 * 2 ** (1 / 3 - 0.5), 24 * 2 ** (1 / 3 + 0.5)]
    )


def test_decoding() -> None:
    generator = torch.Generator().manual_seed(1)
    offsets, anchors = (torch.randn(50, 4, generator=generator), torch.rand(50, 4, generator=generator) + 0.1)
    for box, (dx, dy, dw, dh), (x, y, w, h) in zip(
        decode(offsets, anchors).tolist(), offsets.tolist(), anchors.tolist(), strict=True
    ):
        cx, cy, width, height = x + 0.1 * dx * w, y + 0.1 * dy * h, w * math.exp(0.2 * dw), h * math.exp(0.2 * dh)
        assert box == pytest.approx([cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2], abs=1e-5)


def slow_iou(a: list[float], b: list[float]) -> float:
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    both = max(width, 0) * max(height, 0)
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def slow_fast_nms(boxes: list[list[float]], scores: list[list[float]]) -> list[tuple[int, int]]:
    """(anchor, class) of what is kept, best first; `scores` without background."""
    anchors = [index for index, row in enumerate(scores) if max(row) > 0.05]
    kept = []
    for number in range(len(scores[0])):
        ranked = sorted(anchors, key=lambda index: -scores[index][number])[:200]
        for place, index in enumerate(ranked):
            if all(slow_iou(boxes[better], boxes[index]) <= 0.5 for better in ranked[:place]):
                kept.append((index, number))
    return sorted(kept, key=lambda pair: -scores[pair[0]][pair[1]])[:100]


@pytest.mark.parametrize(
    ("anchors", "classes", "sharpness"), [(300, 3, 4.0), (60, 5, 2.0), (600, 1, 3.0), (40, 80, 0.1)]
)
def test_fast_nms(anchors: int, classes: int, sharpness: float) -> None:
    generator = torch.Generator().manual_seed(2)
    corners = torch.rand(anchors, 2, generator=generator).round(decimals=1)  # many overlap
    boxes = torch.cat([corners, corners + 0.2 + 0.1 * torch.rand(anchors, 2, generator=generator)], dim=1)
    probabilities = torch.softmax(sharpness * torch.randn(anchors, classes + 1, generator=generator), dim=1)
    coefficients = torch.arange(anchors, dtype=torch.float32)[:, None]
    found = fast_nms(boxes, coefficients, probabilities)
    wanted = slow_fast_nms(boxes.tolist(), probabilities[:, 1:].tolist())
    assert len(wanted) == (0 if sharpness == 0.1 else pytest.approx(100, abs=70))
    assert list(zip(found.coefficients[:, 0].int().tolist(), found.classes.tolist(), strict=True)) == wanted
    torch.testing.assert_close(found.boxes, boxes[[anchor for anchor, _ in wanted]])
    assert found.scores.tolist() == [probabilities[anchor, number + 1].item() for anchor, number in wanted]


def test_the_limits_of_fast_nms() -> None:
    def found(scores: Tensor) -> list[float]:
        corners = torch.arange(float(len(scores)))[:, None].expand(-1, 2)  # apart from each other
        boxes = torch.cat([corners, corners + 0.5], dim=1)
        probabilities = torch.stack([1 - scores, scores], dim=1)
        return fast_nms(boxes, scores[:, None], probabilities).scores.tolist()

    assert found(torch.tensor([0.0499, 0.05, 0.0501])) == [pytest.approx(0.0501)]
    many = torch.linspace(0.9, 0.1, 300)
    assert found(many) == many[:100].tolist()
    lower = torch.cat([torch.full((200,), 0.9), torch.tensor([0.8])])
    boxes = torch.tensor([[0.0, 0.0, 1.0, 1.0]] * 200 + [[5.0, 5.0, 6.0, 6.0]])
    kept = fast_nms(boxes, lower[:, None], torch.stack([1 - lower, lower], dim=1)).scores.tolist()
    assert kept == [pytest.approx(0.9)], "the 201st of a class is not looked at, though nothing is near it"


def test_fast_nms_lets_what_is_dropped_drop_others() -> None:
    """Where the greedy algorithm keeps the third of three boxes in a row, the fast one does not."""
    boxes = torch.tensor([[0.0, 0, 0.3, 0.3], [0.08, 0, 0.38, 0.3], [0.16, 0, 0.46, 0.3]])
    probabilities = torch.tensor([[0.1, 0.9], [0.2, 0.8], [0.3, 0.7]])
    assert slow_iou(*boxes[[0, 2]].tolist()) < 0.5
    assert fast_nms(boxes, torch.zeros(3, 1), probabilities).scores.tolist() == [pytest.approx(0.9)]


def test_mask_assembly() -> None:
    generator = torch.Generator().manual_seed(3)
    prototypes, coefficients = torch.randn(9, 12, 4, generator=generator), torch.randn(3, 4, generator=generator)
    boxes = torch.tensor([[0.25, 0.4, 0.6, 0.7], [-0.2, -0.3, 0.3, 0.2], [0.52, 0.9, 1.4, 1.2]])
    masks = assemble(prototypes, coefficients, boxes)
    for index, v, u in itertools.product(range(3), range(9), range(12)):
        x1, y1, x2, y2 = boxes[index].tolist()
        inside = x1 * 12 - 1 <= u < x2 * 12 + 1 and y1 * 9 - 1 <= v < y2 * 9 + 1
        total = sum(p * c for p, c in zip(prototypes[v, u].tolist(), coefficients[index].tolist(), strict=True))
        assert masks[index, v, u].item() == pytest.approx(inside / (1 + math.exp(-total)), abs=1e-5)


def slow_bilinear(image: np.ndarray, height: int, width: int) -> np.ndarray:
    out = np.zeros((height, width))
    for v, u in itertools.product(range(height), range(width)):
        y = max((v + 0.5) * image.shape[0] / height - 0.5, 0)
        x = max((u + 0.5) * image.shape[1] / width - 0.5, 0)
        y0, x0 = int(y), int(x)
        y1, x1 = min(y0 + 1, image.shape[0] - 1), min(x0 + 1, image.shape[1] - 1)
        fy, fx = y - y0, x - x0
        top = (1 - fx) * image[y0, x0] + fx * image[y0, x1]
        out[v, u] = (1 - fy) * top + fy * ((1 - fx) * image[y1, x0] + fx * image[y1, x1])
    return out


def test_the_certainty_of_a_mask_is_the_mean_of_what_belongs_to_it() -> None:
    soft = np.random.default_rng(4).random((4, 5, 7), np.float32)
    soft[2] = np.minimum(soft[2], 0.5)
    wanted = [soft[n][soft[n] > 0.5].mean() if n != 2 else 0.0 for n in range(4)]
    np.testing.assert_allclose(certainties(soft, 0.5), wanted, rtol=1e-6)


def test_masks_at_the_size_of_the_image() -> None:
    soft = torch.rand(6, 5, 7, generator=torch.Generator().manual_seed(4))
    soft[1, :, :3] = soft[2, :2] = soft[3, :, 5:] = soft[4, 3:] = 0  # outside of a box
    soft[5] = 0
    for size in ((23, 31), (4, 3)):
        masks, kept = stretched_above(soft.numpy(), 0.5, *size, 1)
        np.testing.assert_array_equal(kept, range(5))
        for mask, known in zip(masks, soft[:5], strict=True):
            np.testing.assert_array_equal(mask, slow_bilinear(known.numpy(), *size) > 0.5)
        by_torch = functional.interpolate(soft[None], size, mode="bilinear", align_corners=False)[0] > 0.5
        np.testing.assert_array_equal(masks, by_torch[:5])
        pixels = by_torch.sum(dim=(1, 2))
        large = pixels >= pixels.median()
        masks, kept = stretched_above(soft.numpy(), 0.5, *size, int(pixels.median()))
        np.testing.assert_array_equal(masks, by_torch[large])
        np.testing.assert_array_equal(kept, np.flatnonzero(large))


def seen(rgb: np.ndarray, depth_m: np.ndarray) -> RgbdFrame:
    """A frame of these images (11, 14)."""
    camera = Intrinsics(width=14, height=11, fx=10.0, fy=10.0, cx=6.5, cy=5.0)
    return RgbdFrame(index=0, timestamp_s=0.0, rgb=rgb, depth_m=depth_m, intrinsics=camera)


def test_images_are_stretched_and_normalised() -> None:
    rgb = np.random.default_rng(5).integers(0, 256, (11, 14, 3), dtype=np.uint8)
    image = network_image(seen(rgb, np.zeros((11, 14), np.float32)), replace(YOLACT, height=7, width=19), CPU)
    assert image.shape == (1, 3, 7, 19)
    for channel, mean, std in ((0, 123.68, 58.40), (1, 116.78, 57.12), (2, 103.94, 57.38)):
        wanted = (slow_bilinear(rgb[..., channel].astype(float), 7, 19) - mean) / std
        np.testing.assert_allclose(image[0, channel], wanted, atol=1e-5)


def test_depth_is_given_as_its_inverse_from_the_nearest_pixel() -> None:
    rng = np.random.default_rng(6)
    depth_m = rng.uniform(0.5, 6.0, (11, 14)).astype(np.float32)
    depth_m[rng.random(depth_m.shape) < 0.3] = 0.0
    for height, width in ((7, 19), (22, 7), (11, 14)):
        got = stretched(depth_m, height, width)
        for v, u in itertools.product(range(height), range(width)):
            # The centre of the pixel, in the image's own rows and columns.
            row, column = (v + 0.5) * 11 / height, (u + 0.5) * 14 / width
            assert got[v, u] == depth_m[int(row), int(column)]
    told = depth_channel(torch.tensor([0.0, 0.5, 1.0, 2.5]))
    torch.testing.assert_close(told, torch.tensor([-0.4, 1.6, 0.6, 0.0]) / 0.3)
    frame = seen(rng.integers(0, 256, (11, 14, 3), dtype=np.uint8), depth_m)
    image = network_image(frame, replace(COMPACT, height=22, width=7), CPU)
    torch.testing.assert_close(image[:, :3], network_image(frame, replace(YOLACT, height=22, width=7), CPU))
    torch.testing.assert_close(image[0, 3], depth_channel(torch.tensor(stretched(depth_m, 22, 7))))
    assert network_image(frame, YOLACT, CPU).shape == (1, 3, 550, 550), "YOLACT knows colours alone"


def slow_deformable(x, offsets, modulation, weight, bias, stride: int, padding: int) -> Tensor:
    """Equation 1 of the paper, tap by tap and corner by corner."""
    batch, channels, height, width = x.shape
    kernel = weight.shape[2]
    rows, columns = modulation.shape[2:]
    out = bias[None, :, None, None].repeat(batch, 1, rows, columns)
    for b, i, j, r, c in itertools.product(range(batch), range(rows), range(columns), range(kernel), range(kernel)):
        tap = r * kernel + c
        v = i * stride - padding + r + offsets[b, 2 * tap, i, j].item()
        u = j * stride - padding + c + offsets[b, 2 * tap + 1, i, j].item()
        value = torch.zeros(channels, dtype=x.dtype)
        for p, q in itertools.product((math.floor(v), math.floor(v) + 1), (math.floor(u), math.floor(u) + 1)):
            if 0 <= p < height and 0 <= q < width:
                value = value + (1 - abs(v - p)) * (1 - abs(u - q)) * x[b, :, p, q]
        out[b, :, i, j] += weight[:, :, r, c] @ value * modulation[b, tap, i, j]
    return out


@pytest.mark.parametrize("stride", [1, 2])
def test_deformable_convolution(stride: int) -> None:
    generator = torch.Generator().manual_seed(6)

    def draw(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    x, weight, bias = draw(2, 3, 6, 7), draw(4, 3, 3, 3), draw(4)
    rows, columns = (6 - 1) // stride + 1, (7 - 1) // stride + 1
    offsets, modulation = 3 * draw(2, 18, rows, columns), torch.sigmoid(draw(2, 9, rows, columns))
    offsets[:, :4] = offsets[:, :4].round()  # whole pixels, and far outside
    offsets[0, 4] = 50.0
    told = deformable_conv2d(x, offsets, modulation, weight, bias, stride=stride, padding=1)
    wanted = slow_deformable(x, offsets, modulation, weight, bias, stride, 1)
    torch.testing.assert_close(told, wanted, atol=1e-12, rtol=0)
    single = deformable_conv2d(*(t.float() for t in (x, offsets, modulation, weight, bias)), stride=stride, padding=1)
    torch.testing.assert_close(single.double(), wanted, atol=2e-5, rtol=0)


def test_a_new_deformable_convolution_is_half_an_ordinary_one() -> None:
    torch.manual_seed(7)
    layer, x = DeformableConv2d(3, 5, 2), torch.randn(1, 3, 9, 8)
    torch.testing.assert_close(layer(x), functional.conv2d(x, layer.weight / 2, stride=2, padding=1), atol=1e-5, rtol=0)


def test_half_precision_samples_at_the_right_place() -> None:
    """On a ramp as wide as P3 the answer is the place itself: float16 keeps 11 bits of it, not of a coordinate."""
    ramp = torch.linspace(0, 1, 138).expand(1, 1, 138, 138)
    offsets, modulation = torch.full((1, 18, 138, 138), 0.3), torch.ones(1, 9, 138, 138)
    weight = torch.zeros(1, 1, 3, 3)
    weight[0, 0, 1, 1] = 1
    exact, half = (
        deformable_conv2d(
            *(t.to(kind) for t in (ramp, offsets, modulation, weight, torch.zeros(1))), stride=1, padding=1
        )
        for kind in (torch.float64, torch.float16)
    )
    error_px = (half.double() - exact)[0, 0, :-1, :-1].abs().max().item() * 137
    assert error_px < 137 * 2**-11
