"""torchvision's Mask R-CNN behind our interface, small and with random weights.

Where torchvision's compiled operators do not load (its wheels do not fit every build of PyTorch), two of them are stood
in for by a few lines of PyTorch, so that the network itself is tested all the same.
"""

import importlib
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from dotmask.errors import SegmenterError
from dotmask.records import Intrinsics, RgbdFrame
from dotmask.segmentation.coco import COCO_CLASSES
from dotmask.segmentation.networks import choose_network, load_network

torch.set_num_threads(1)


def _nms(boxes: Tensor, scores: Tensor, most_iou: float) -> Tensor:
    order, kept = scores.argsort(descending=True, stable=True), []
    area = (boxes[:, 2:] - boxes[:, :2]).prod(dim=1)
    while len(order):
        best, rest = order[0], order[1:]
        sides = torch.minimum(boxes[best, 2:], boxes[rest, 2:]) - torch.maximum(boxes[best, :2], boxes[rest, :2])
        both = sides.clamp(min=0).prod(dim=1)
        order = rest[both / (area[best] + area[rest] - both) <= most_iou]
        kept.append(best)
    return torch.stack(kept) if kept else order


def _roi_align(x: Tensor, rois: Tensor, scale: float, rows: int, columns: int, samples: int, aligned: bool) -> Tensor:
    assert samples == 2
    assert not aligned
    height, width = x.shape[2:]
    out = x.new_zeros(len(rois), x.shape[1], rows, columns)
    for index, (batch, *corners) in enumerate(rois.tolist()):
        x1, y1, x2, y2 = (corner * scale for corner in corners)
        u = x1 + (torch.arange(2 * columns) + 0.5) * max(x2 - x1, 1.0) / (2 * columns)
        v = y1 + (torch.arange(2 * rows) + 0.5) * max(y2 - y1, 1.0) / (2 * rows)
        u, v = 2 * u.clamp(0, width - 1) / (width - 1) - 1, 2 * v.clamp(0, height - 1) / (height - 1) - 1
        grid = torch.stack(torch.meshgrid(u, v, indexing="xy"), dim=-1)[None]
        sampled = functional.grid_sample(x[int(batch) : int(batch) + 1], grid, align_corners=True)
        out[index] = functional.avg_pool2d(sampled, 2)[0]
    return out


SCHEMAS = (
    "nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
    "qnms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
    "roi_align(Tensor input, Tensor rois, float spatial_scale, SymInt pooled_height, SymInt pooled_width, "
    "int sampling_ratio, bool aligned) -> Tensor",
)


@pytest.fixture(scope="module")
def torchvision() -> ModuleType:
    """torchvision, with or without its compiled operators."""
    try:
        return importlib.import_module("torchvision")
    except RuntimeError:
        for name in [name for name in sys.modules if name.partition(".")[0] == "torchvision"]:
            del sys.modules[name]
    operators = torch.library.Library("torchvision", "DEF")
    for schema in SCHEMAS:
        operators.define(schema)
    operators.impl("nms", _nms, "CPU")
    operators.impl("roi_align", _roi_align, "CPU")
    found = importlib.import_module("torchvision")
    found.operators_of_the_tests = operators  # they go when this object goes
    for name in ("boxes", "roi_align"):
        module = sys.modules[f"torchvision.ops.{name}"]
        module._assert_has_ops = lambda: None
        module._has_ops = lambda: True
    return found


def frame() -> RgbdFrame:
    rgb = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    camera = Intrinsics(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
    return RgbdFrame(index=0, timestamp_s=0.0, rgb=rgb, depth_m=np.ones((48, 64), np.float32), intrinsics=camera)


def test_a_small_mask_rcnn_answers_in_the_projects_conventions(torchvision: ModuleType) -> None:
    from dotmask.segmentation.mask_rcnn import MaskRcnnSegmenter

    torch.manual_seed(0)
    network = torchvision.models.detection.maskrcnn_resnet50_fpn(
        weights=None,
        weights_backbone=None,
        min_size=32,
        max_size=64,
        rpn_post_nms_top_n_test=4,
        box_detections_per_img=3,
    )
    predictor = network.roi_heads.box_predictor
    torch.nn.init.zeros_(predictor.cls_score.weight)
    torch.nn.init.constant_(predictor.cls_score.bias, -9.0)
    predictor.cls_score.bias.data[62] = 2.0  # COCO's own number of a chair
    segmenter = MaskRcnnSegmenter(network, torch.device("cpu"))
    found, again = segmenter.segment(frame()), segmenter.segment(frame())
    with torch.inference_mode():
        raw = network([torch.tensor(frame().rgb).permute(2, 0, 1) / 255])[0]
    assert len(found) > 0
    assert set(found.class_names) == {"chair"}
    assert found.masks.shape[1:] == (48, 64)
    assert found.masks.tobytes() == again.masks.tobytes()
    told = {
        (score, tuple(np.clip(np.subtract(box, (0, 0, 1, 1)), 0, (63, 47, 63, 47)).round(3)))
        for score, box in zip(raw["scores"].tolist(), raw["boxes"].tolist(), strict=True)
    }
    for score, box in zip(found.scores.tolist(), found.boxes_px, strict=True):
        assert (score, tuple(box.round(3))) in told


def test_its_names_are_those_of_the_other_networks(torchvision: ModuleType) -> None:
    from dotmask.segmentation.mask_rcnn import PUBLISHED

    assert [name for name in PUBLISHED.meta["categories"] if name not in ("__background__", "N/A")] == list(
        COCO_CLASSES
    )


def test_the_backbone_of_yolact_is_torchvisions_resnet(torchvision: ModuleType) -> None:
    """A second implementation: the same weights under torchvision's names give the same features."""
    from dotmask.segmentation.yolact.resnet import ResNet50

    torch.manual_seed(1)
    ours, theirs = ResNet50(is_deformable=False).eval(), torchvision.models.resnet50(weights=None).eval()
    renamed = {
        key if not key.startswith("layers.") else f"layer{int(key[7]) + 1}{key[8:]}": value
        for key, value in ours.state_dict().items()
    }
    missing, unexpected = theirs.load_state_dict(renamed, strict=False)
    assert (missing, unexpected) == (["fc.weight", "fc.bias"], [])
    image = torch.randn(1, 3, 75, 75)
    with torch.inference_mode():
        x = theirs.layer1(theirs.maxpool(theirs.relu(theirs.bn1(theirs.conv1(image)))))
        for feature, layer in zip(ours(image), (theirs.layer2, theirs.layer3, theirs.layer4), strict=True):
            x = layer(x)
            torch.testing.assert_close(feature, x)


def _published(torchvision: ModuleType, monkeypatch: pytest.MonkeyPatch) -> torch.nn.Module:
    """The network as torchvision makes it for the published weights, without fetching them."""
    weights = torchvision.models.detection.MaskRCNN_ResNet50_FPN_Weights.COCO_V1
    monkeypatch.setattr(type(weights), "get_state_dict", lambda *_, **__: {})
    monkeypatch.setattr(torch.nn.Module, "load_state_dict", lambda *_, **__: None)
    made: torch.nn.Module = torchvision.models.detection.maskrcnn_resnet50_fpn(weights=weights)
    monkeypatch.undo()
    return made.eval()


def test_the_network_is_the_one_of_the_published_weights(
    torchvision: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dotmask.segmentation.mask_rcnn import PUBLISHED, mask_rcnn

    with torch.device("meta"):
        ours, theirs = mask_rcnn().eval(), _published(torchvision, monkeypatch)
    assert repr(ours) == repr(theirs)
    assert {m.eps for m in theirs.modules() if isinstance(m, torchvision.ops.FrozenBatchNorm2d)} == {0.0}
    assert sum(tensor.numel() for tensor in ours.parameters()) == PUBLISHED.meta["num_params"]


def test_the_names_of_the_published_file_are_read_as_torchvision_reads_them(torchvision: ModuleType) -> None:
    from dotmask.segmentation.mask_rcnn import current_name, mask_rcnn

    network = mask_rcnn()
    now = network.state_dict()
    old = {}
    for index, (key, tensor) in enumerate(now.items()):
        name = key
        if "_blocks." in key:
            name = key.replace(".0.weight", ".weight").replace(".0.bias", ".bias")
        elif key.startswith("rpn.head.conv."):
            name = key.replace(".0.0.", ".")
        elif key.startswith("roi_heads.mask_head."):
            number = int(key.split(".")[2])
            name = f"roi_heads.mask_head.mask_fcn{number + 1}.{key.split('.')[4]}"
        old[name] = torch.full((), float(index)).expand_as(tensor)
    assert {current_name(name): tensor[(0,) * tensor.ndim].item() for name, tensor in old.items()} == {
        key: float(index) for index, key in enumerate(now)
    }
    network.load_state_dict(old)  # torchvision's own renaming, strict
    assert [tensor.flatten()[0].item() for tensor in network.state_dict().values()] == list(map(float, range(len(now))))
    assert current_name("backbone.body.bn1.num_batches_tracked") is None


def test_weights_from_a_file_and_from_the_cache(
    torchvision: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dotmask.segmentation import mask_rcnn

    monkeypatch.setattr(mask_rcnn, "mask_rcnn", lambda: torch.nn.Linear(2, 3))  # the whole one takes 170 MB
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    with pytest.raises(
        SegmenterError, match=r"torchvision has not downloaded its weights to .*; fetch https://.*pth and"
    ):
        choose_network("mask_rcnn", None, "cpu")
    cached = tmp_path / "hub" / "checkpoints" / "maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth"
    cached.parent.mkdir(parents=True)
    torch.save(torch.nn.Linear(2, 3).state_dict(), cached)
    choice = choose_network("mask_rcnn", None, "cpu")
    assert choice.weights == cached
    assert choose_network("mask_rcnn", cached, "cpu").weights_sha256 == choice.weights_sha256
    load_network(choice)
    torch.save(torch.nn.Linear(2, 4).state_dict(), cached)
    with pytest.raises(SegmenterError, match="no weights of mask_rcnn: tensor weight is 4x2, expected 3x2"):
        load_network(choose_network("mask_rcnn", None, "cpu"))
