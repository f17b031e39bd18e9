"""The networks as a whole: tensors, wiring, determinism, and what the segmenter makes of the answer."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.coco import COCO_CLASSES
from dotmask.segmentation.yolact.design import COMPACT, YOLACT, YOLACT_PLUS, YolactDesign
from dotmask.segmentation.yolact.heads import FinePrototypes
from dotmask.segmentation.yolact.network import Yolact
from dotmask.segmentation.yolact.segmenter import YolactSegmenter

torch.set_num_threads(1)
TENSORS = Path(__file__).parent / "yolact_tensors"
CPU = torch.device("cpu")


def make(design: YolactDesign, seed: int = 0) -> Yolact:
    """A network with random weights, whose batch norms and offsets are no identities."""
    torch.manual_seed(seed)
    network = Yolact(design).eval()
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            for values, centre in ((module.weight, 1.0), (module.bias, 0.0), (module.running_mean, 0.0)):
                torch.nn.init.normal_(values, centre, 0.1)
            torch.nn.init.uniform_(module.running_var, 0.5, 1.5)
    for name, values in network.named_parameters():
        if "conv_offset_mask" in name:
            torch.nn.init.normal_(values, 0, 0.02)
    return network


def frame(width: int = 160, height: int = 120, seed: int = 0) -> RgbdFrame:
    rgb = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    camera = Intrinsics(width=width, height=height, fx=width, fy=width, cx=(width - 1) / 2, cy=(height - 1) / 2)
    return RgbdFrame(index=0, timestamp_s=0.0, rgb=rgb, depth_m=np.ones((height, width), np.float32), intrinsics=camera)


@pytest.mark.parametrize(("design", "name"), [(YOLACT, "yolact"), (YOLACT_PLUS, "yolact_plus")])
def test_every_tensor_is_called_and_shaped_as_in_the_authors_checkpoint(design: YolactDesign, name: str) -> None:
    with torch.device("meta"):
        have = [f"{key} {'x'.join(map(str, t.shape)) or 'scalar'}" for key, t in Yolact(design).state_dict().items()]
    lines = (TENSORS / f"{name}_resnet50.txt").read_text().splitlines()
    assert have == [line for line in lines if not line.startswith("#")]


def test_compact_fits_into_its_file() -> None:
    with torch.device("meta"):
        values = sum(t.numel() for t in Yolact(COMPACT).state_dict().values())
    assert 2e6 < values < 12e6 / 4


class Written:
    """The networks once more, as functions of the tensors' names: from the papers' figures and the tables of facts."""

    def __init__(self, network: Yolact) -> None:
        self.tensors = {key: value.double() for key, value in network.state_dict().items()}

    def conv(self, x: Tensor, name: str, stride: int = 1) -> Tensor:
        weight = self.tensors[f"{name}.weight"]
        return functional.conv2d(x, weight, self.tensors.get(f"{name}.bias"), stride, weight.shape[2] // 2)

    def norm(self, x: Tensor, name: str) -> Tensor:
        mean, variance, weight, bias = (
            self.tensors[f"{name}.{part}"][:, None, None] for part in ("running_mean", "running_var", "weight", "bias")
        )
        return (x - mean) / torch.sqrt(variance + 1e-5) * weight + bias

    def deformable(self, x: Tensor, name: str, stride: int) -> Tensor:
        """Tap by tap, each sampled from its four corners."""
        told = self.conv(x, f"{name}.conv_offset_mask", stride)
        height, width = x.shape[2:]
        rows, columns = (torch.arange(n, dtype=torch.float64) for n in told.shape[2:])
        out = self.tensors[f"{name}.bias"][None, :, None, None]
        for tap in range(9):
            v = rows[:, None] * stride + tap // 3 - 1 + told[0, 2 * tap]
            u = columns * stride + tap % 3 - 1 + told[0, 2 * tap + 1]
            value = torch.zeros(())
            for p, q in ((0, 0), (0, 1), (1, 0), (1, 1)):
                row, column = v.floor() + p, u.floor() + q
                is_inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
                share = (1 - (v - row).abs()) * (1 - (u - column).abs()) * is_inside
                pixels = x[:, :, row.clamp(0, height - 1).long(), column.clamp(0, width - 1).long()]
                value = value + share * pixels
            weight = self.tensors[f"{name}.weight"][:, :, tap // 3, tap % 3]
            out = out + torch.einsum("oc,bchw->bohw", weight, value * torch.sigmoid(told[:, 18 + tap, None]))
        return out

    def backbone(self, x: Tensor) -> list[Tensor]:
        x = functional.max_pool2d(self.norm(self.conv(x, "backbone.conv1", 2), "backbone.bn1").relu(), 3, 2, 1)
        features = []
        for stage, blocks in enumerate((3, 4, 6, 3)):
            for block in range(blocks):
                name, stride = f"backbone.layers.{stage}.{block}", 2 if stage and not block else 1
                y = self.norm(self.conv(x, f"{name}.conv1"), f"{name}.bn1").relu()
                is_deformable = f"{name}.conv2.bias" in self.tensors
                y = (self.deformable if is_deformable else self.conv)(y, f"{name}.conv2", stride)
                y = self.norm(self.conv(self.norm(y, f"{name}.bn2").relu(), f"{name}.conv3"), f"{name}.bn3")
                if f"{name}.downsample.0.weight" in self.tensors:
                    x = self.norm(self.conv(x, f"{name}.downsample.0", stride), f"{name}.downsample.1")
                x = (x + y).relu()
            features.append(x)
        return features[1:]

    def pyramid(self, features: list[Tensor]) -> list[Tensor]:
        c3, c4, c5 = features
        p5 = self.conv(c5, "fpn.lat_layers.0")
        p4 = self.conv(c4, "fpn.lat_layers.1") + functional.interpolate(p5, size=c4.shape[2:], mode="bilinear")
        p3 = self.conv(c3, "fpn.lat_layers.2") + functional.interpolate(p4, size=c3.shape[2:], mode="bilinear")
        levels = [self.conv(p, f"fpn.pred_layers.{n}").relu() for n, p in ((2, p3), (1, p4), (0, p5))]
        levels.append(self.conv(levels[-1], "fpn.downsample_layers.0", 2))
        levels.append(self.conv(levels[-1], "fpn.downsample_layers.1", 2))
        return levels

    def prototypes(self, p3: Tensor) -> Tensor:
        for layer in (0, 2, 4):
            p3 = self.conv(p3, f"proto_net.{layer}").relu()
        x = functional.interpolate(p3, scale_factor=2, mode="bilinear")
        return self.conv(self.conv(x, "proto_net.8").relu(), "proto_net.10").relu()[0].permute(1, 2, 0)

    def head(self, levels: list[Tensor], layer: str, numbers: int) -> Tensor:
        told = []
        for level in levels:
            x = self.conv(level, "prediction_layers.0.upfeature.0").relu()
            told.append(self.conv(x, f"prediction_layers.0.{layer}")[0].permute(1, 2, 0).reshape(-1, numbers))
        return torch.cat(told)

    def mask_ious(self, masks: Tensor) -> Tensor:
        x = masks[:, None]
        for layer in range(0, 10, 2):
            name = f"maskiou_net.maskiou_net.{layer}"
            x = functional.conv2d(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"], 2).relu()
        return self.conv(x, "maskiou_net.maskiou_net.10").relu().amax(dim=(2, 3))


@pytest.mark.parametrize("design", [YOLACT, YOLACT_PLUS], ids=["yolact", "yolact++"])
def test_the_network_is_what_the_papers_draw(design: YolactDesign) -> None:
    network = make(replace(design, height=75, width=75)).double()
    written = Written(network)
    image = torch.randn(1, 3, 75, 75, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    with torch.inference_mode():
        answer = network(image)
        levels = written.pyramid(written.backbone(image))
        close = {"atol": 1e-8, "rtol": 1e-8}
        torch.testing.assert_close(answer.offsets[0], written.head(levels, "bbox_layer", 4), **close)
        torch.testing.assert_close(answer.logits[0], written.head(levels, "conf_layer", 81), **close)
        torch.testing.assert_close(answer.coefficients[0], written.head(levels, "mask_layer", 32).tanh(), **close)
        torch.testing.assert_close(answer.prototypes[0], written.prototypes(levels[0]), **close)
        assert answer.semantic is None
        if network.maskiou_net is not None:
            masks = torch.rand(2, 138, 138, dtype=torch.float64)
            torch.testing.assert_close(network.maskiou_net(masks), written.mask_ious(masks), **close)


def test_fine_prototypes_are_made_as_drawn() -> None:
    """P3 -> three blocks -> twice as large, with C2 -> one block -> twice as large, with C1 -> prototypes."""
    net, generator = FinePrototypes((5, 7), 16, 3, is_normalised=True), torch.Generator().manual_seed(2)
    tensors = net.state_dict()
    p3, half, quarter = (
        torch.randn(1, n, h, w, generator=generator) for n, h, w in ((16, 3, 4), (5, 12, 16), (7, 6, 8))
    )

    def block(x: Tensor, name: str) -> Tensor:
        x = functional.conv2d(x, tensors[f"{name}.0.weight"], tensors[f"{name}.0.bias"], padding=1)
        groups = x.reshape(1, 2, -1)  # 8 channels each
        deviations = groups - groups.mean(dim=2, keepdim=True)
        x = (deviations / (deviations.square().mean(dim=2, keepdim=True) + 1e-5).sqrt()).reshape(x.shape)
        return (x * tensors[f"{name}.1.weight"][:, None, None] + tensors[f"{name}.1.bias"][:, None, None]).relu()

    def merged(x: Tensor, fine: Tensor, name: str) -> Tensor:
        lateral = torch.einsum("bchw,kc->bkhw", fine, tensors[f"{name}.weight"][:, :, 0, 0])
        lateral += tensors[f"{name}.bias"][:, None, None]
        return (functional.interpolate(x, scale_factor=2, mode="bilinear") + lateral).relu()

    x = block(block(block(p3, "coarse.0"), "coarse.2"), "coarse.4")
    x = block(merged(x, quarter, "quarter_lateral"), "at_quarter.0")
    x = merged(x, half, "half_lateral")
    expected = functional.conv2d(x, tensors["at_half.weight"], tensors["at_half.bias"], padding=1)
    torch.testing.assert_close(net(p3, half, quarter), expected, atol=1e-5, rtol=1e-5)


def last_of_prototypes(network: Yolact) -> torch.nn.Conv2d:
    """The convolution that the prototypes come from."""
    net = network.proto_net
    return net.at_half if isinstance(net, FinePrototypes) else net[10]


def detecting(design: YolactDesign, class_name: str) -> Yolact:
    """A network that takes the first anchor of every cell for a class with probability 0.9; its masks have pixels."""
    network = make(design)
    numbers = len(design.class_names) + 1
    layer = network.prediction_layers[0].conf_layer
    torch.nn.init.zeros_(layer.weight)
    torch.nn.init.zeros_(layer.bias)
    chosen = 1 + design.class_names.index(class_name)
    layer.bias.data[0] = 20.0
    layer.bias.data[chosen] = 20.0 + np.log(9.0)
    for anchor in range(1, design.anchors_a_cell):
        layer.bias.data[anchor * numbers] = 20.0
    network.prediction_layers[0].mask_layer.bias.data += 0.5
    last_of_prototypes(network).bias.data += 0.1
    return network


def test_yolact_at_its_full_size_is_deterministic_and_answers_in_the_projects_conventions() -> None:
    segmenter = YolactSegmenter(detecting(YOLACT, "chair"), YOLACT, CPU)
    first, again = segmenter.segment(frame()), segmenter.segment(frame())
    assert first.masks.tobytes() == again.masks.tobytes()
    assert first.boxes_px.tobytes() == again.boxes_px.tobytes()
    assert first.scores.tobytes() == again.scores.tobytes()
    assert set(first.class_names) == {"chair"}
    assert 3 < len(first) <= 100
    np.testing.assert_allclose(first.scores, 0.9, atol=1e-6)
    assert first.masks.shape == (len(first), 120, 160)
    assert first.masks.any(axis=(1, 2)).all()
    assert (first.boxes_px >= 0).all()
    assert (first.boxes_px <= (159, 119, 159, 119)).all()
    for mask, box in zip(first.masks, first.boxes_px, strict=True):
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        margin = 1.5 * 160 / 138 + 1  # a pixel of the prototypes, and half of one by stretching
        assert columns[0] >= box[0] - margin
        assert columns[-1] <= box[2] + margin
        assert rows[0] >= box[1] - margin
        assert rows[-1] <= box[3] + margin


def test_a_box_is_told_by_the_centres_of_its_outermost_pixels() -> None:
    """With offsets of 0 an anchor is the box, so that everything is known."""
    design = replace(COMPACT, scales_px=((18.0,), (32.0,), (64.0,), (128.0,), (80.0,)), aspect_ratios=(1.0,))
    network = detecting(design, "cup")
    head = network.prediction_layers[0]
    for values in (*head.bbox_layer.parameters(), head.mask_layer.weight, last_of_prototypes(network).weight):
        torch.nn.init.zeros_(values)
    torch.nn.init.constant_(head.mask_layer.bias, 9.0)
    torch.nn.init.ones_(last_of_prototypes(network).bias)  # every mask fills its box, and a margin
    found = YolactSegmenter(network, design, CPU).segment(frame(320, 240))
    # P3 has a square of 18 px every 8 px, the first around 4, 4; of equal scores the first ones are kept.
    np.testing.assert_allclose(found.boxes_px[:2], [[0, 0, 12, 12], [3, 0, 20, 12]], atol=1e-4)
    box = next(index for index, box in enumerate(found.boxes_px) if np.allclose(box, [11, 11, 28, 28], atol=1e-4))
    rows, columns = np.nonzero(found.masks[box])
    # 11..29 is 5.5..14.5 of the prototypes, and with the margin 4.5..15.5: the pixels 5 to 15 of them.
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (10, 31, 10, 31)


def test_scores_of_yolact_plus_are_multiplied_with_the_expected_iou() -> None:
    design = replace(YOLACT_PLUS, height=256, width=256)
    network = detecting(design, "person")
    assert network.maskiou_net is not None
    last = network.maskiou_net.maskiou_net[10]
    torch.nn.init.zeros_(last.weight)
    torch.nn.init.constant_(last.bias, 0.2)
    last.bias.data[COCO_CLASSES.index("person")] = 0.7
    found = YolactSegmenter(network, design, CPU).segment(frame())
    assert len(found) > 3
    np.testing.assert_allclose(found.scores, 0.63, atol=1e-5)
    assert (found.masks.sum(axis=(1, 2)) >= 25).all()


def test_scores_of_compact_are_multiplied_with_the_certainty_of_the_mask() -> None:
    network = detecting(COMPACT, "cup")
    head = network.prediction_layers[0]
    for values in (head.mask_layer.weight, last_of_prototypes(network).weight):
        torch.nn.init.zeros_(values)
    torch.nn.init.constant_(head.mask_layer.bias, np.arctanh(2 / 3 / COMPACT.prototypes))
    torch.nn.init.ones_(last_of_prototypes(network).bias)
    found = YolactSegmenter(network, COMPACT, CPU).segment(frame(320, 240))
    assert len(found) > 3
    np.testing.assert_allclose(found.scores, 0.9 / (1 + np.exp(-2 / 3)), atol=1e-5)


@pytest.mark.parametrize("design", [COMPACT, replace(YOLACT_PLUS, height=256, width=256)], ids=["compact", "yolact++"])
def test_half_precision_as_on_a_gpu_finds_nearly_the_same(design: YolactDesign) -> None:
    network = detecting(design, "person")
    if network.maskiou_net is not None:
        network.maskiou_net.maskiou_net[10].bias.data += 0.7
    single = YolactSegmenter(network, design, CPU).segment(frame(320, 240))
    segmenter = YolactSegmenter(network, design, CPU)
    segmenter._type, segmenter._network = torch.float16, network.half()
    half = segmenter.segment(frame(320, 240))
    assert len(half) == len(single) > 3
    apart = np.abs(single.boxes_px[:, None] - half.boxes_px[None]).max(axis=2).min(axis=1)
    assert np.quantile(apart, 0.9) < 0.05, "pixels"
    np.testing.assert_allclose(np.sort(half.scores), np.sort(single.scores), atol=2e-3)


def test_nothing_found_is_no_error() -> None:
    for design in (COMPACT, replace(YOLACT_PLUS, height=75, width=75)):
        network = make(design)
        for values in network.prediction_layers[0].conf_layer.parameters():
            torch.nn.init.zeros_(values)  # all classes are as likely
        network.prediction_layers[0].conf_layer.bias.data[:: len(design.class_names) + 1] = 9.0  # but the background
        found = YolactSegmenter(network, design, CPU).segment(frame())
        assert (len(found), found.masks.shape) == (0, (0, 120, 160))


def test_training_gives_a_semantic_answer_too() -> None:
    network = make(COMPACT).train()
    answer = network(torch.zeros(2, 4, 240, 320))
    assert answer.semantic.shape == (2, 4, 30, 40)
    assert answer.prototypes.shape == (2, 120, 160, 24)
    assert answer.offsets.shape == (2, 9636, 4)
