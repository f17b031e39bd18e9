"""Weights from files: what fits is loaded, everything else is refused in one line, and nothing is executed."""

import hashlib
import os
import pickle
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from dotmask.errors import SegmenterError
from dotmask.segmentation.checkpoint import load_weights
from dotmask.segmentation.yolact.network import current_name

torch.set_num_threads(1)


def network(seed: int) -> nn.Module:
    torch.manual_seed(seed)
    return nn.Sequential(nn.Conv2d(3, 4, 3), nn.BatchNorm2d(4), nn.Linear(2, 5))


def load(target: nn.Module, path: Path, **more: Callable[[str], str | None]) -> None:
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    load_weights(target, path, "small", sha256, **more)


@pytest.mark.parametrize("name", ["w.pth", "w.safetensors", "legacy.pth"])
def test_what_fits_is_loaded_to_the_last_bit(name: str, tmp_path: Path) -> None:
    path, known, target = tmp_path / name, network(1), network(2)
    if path.suffix == ".safetensors":
        save_file(known.state_dict(), path)
    else:
        torch.save(known.state_dict(), path, _use_new_zipfile_serialization=name == "w.pth")
    load(target, path)
    for key, tensor in known.state_dict().items():
        assert torch.equal(target.state_dict()[key], tensor), key


def test_weights_in_half_precision_fill_a_network_in_single_precision(tmp_path: Path) -> None:
    known, target = network(1), network(2)
    save_file(
        {key: t.half() if t.is_floating_point() else t for key, t in known.state_dict().items()},
        tmp_path / "w.safetensors",
    )
    load(target, tmp_path / "w.safetensors")
    assert target[0].weight.dtype == torch.float32
    assert torch.equal(target[0].weight, known[0].weight.half().float())


CHANGES = {
    "missing": (lambda t: t.pop("1.weight"), "tensor 1.weight is missing"),
    "shape": (lambda t: t.update({"1.bias": torch.zeros(3)}), "tensor 1.bias is 3, expected 4"),
    "scalar": (lambda t: t.update({"0.bias": torch.zeros(())}), "tensor 0.bias is scalar, expected 4"),
    "left over": (lambda t: t.update({"9.weight": torch.zeros(3)}), "it has no tensor 9.weight"),
    "the first of two": (
        lambda t: t.update({"0.weight": torch.zeros(1), "1.bias": torch.zeros(3)}),
        "tensor 0.weight is 1,",
    ),
    "whole numbers": (
        lambda t: t.update({"0.bias": torch.zeros(4, dtype=torch.int64)}),
        "holds torch.int64, expected torch.float32",
    ),
    "not finite": (
        lambda t: t.update({"0.bias": torch.full((4,), torch.nan)}),
        "0.bias holds a number that is not finite",
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_another_networks_weights_are_refused_by_the_first_tensor_that_differs(change: str, tmp_path: Path) -> None:
    alter, message = CHANGES[change]
    tensors, target = network(1).state_dict(), network(2)
    before = {key: tensor.clone() for key, tensor in target.state_dict().items()}
    alter(tensors)
    torch.save(tensors, tmp_path / "w.pth")
    with pytest.raises(SegmenterError, match=re.escape(message)) as told:
        load(target, tmp_path / "w.pth")
    assert str(told.value).startswith(f"{tmp_path / 'w.pth'}: no weights of small: ")
    assert "\n" not in str(told.value)
    assert all(torch.equal(before[key], tensor) for key, tensor in target.state_dict().items()), "half of it was loaded"


class Evil:
    """Unpickled, it makes a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self.path),)


def _write(path: Path, name: str) -> None:
    whole = path.with_name("whole.pth")
    torch.save(network(1).state_dict(), whole)
    content = whole.read_bytes()
    whole.unlink()
    traces = path.with_name("executed")
    if name == "pickle with code":
        path.write_bytes(pickle.dumps({"0.weight": Evil(traces)}, protocol=2))
    elif name == "checkpoint with code":
        torch.save({"0.weight": Evil(traces)}, path)
    elif name == "pickled network":
        torch.save(network(1), path)
    elif name == "checkpoint in a dictionary":
        torch.save({"epoch": 54, "model": network(1).state_dict()}, path)
    elif name == "numpy":
        np.savez(path, weight=np.zeros(3))
        path.with_name(path.name + ".npz").rename(path)
    elif name == "no names":
        torch.save([torch.zeros(3)], path)
    else:
        path.write_bytes(
            {"text": b"hello", "empty": b"", "cut": content[: len(content) // 2], "short": content[:-40]}[name]
        )


REFUSED = {
    "pickle with code": "code or objects beside tensors, and none of it was run",
    "checkpoint with code": "code or objects beside tensors, and none of it was run",
    "pickled network": "code or objects beside tensors, and none of it was run",
    "checkpoint in a dictionary": "expected tensors by name, but 'epoch' is int",
    "no names": "expected tensors by name, got list",
    "numpy": "is no PyTorch file, or is cut short",
    "text": "is no PyTorch file, or is cut short",
    "empty": "is no PyTorch file, or is cut short",
    "cut": "is no PyTorch file, or is cut short",
    "short": "is no PyTorch file, or is cut short",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_checkpoint_is_refused_in_one_line_and_nothing_runs(name: str, tmp_path: Path) -> None:
    path = tmp_path / "w.pth"
    _write(path, name)
    with pytest.raises(SegmenterError, match=re.escape(REFUSED[name])) as told:
        load(network(2), path)
    assert str(told.value).startswith(str(path))
    assert "\n" not in str(told.value)
    assert [p.name for p in tmp_path.iterdir()] == ["w.pth"], "something was executed"


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    for suffix in (".pth", ".safetensors"):
        path = tmp_path / f"w{suffix}"
        if suffix == ".pth":
            torch.save(network(1).state_dict(), path)
        else:
            save_file(network(1).state_dict(), path)
        content = path.read_bytes()
        for length in range(0, len(content), max(len(content) // 60, 1)):
            path.write_bytes(content[:length])
            with pytest.raises(SegmenterError, match=r"is no .* file, or is cut short"):
                load(network(2), path)


def test_a_missing_file_and_one_that_has_changed(tmp_path: Path) -> None:
    with pytest.raises(SegmenterError, match=r"none\.pth: cannot be read \(No such file"):
        load(network(1), tmp_path / "none.pth")
    torch.save(network(1).state_dict(), tmp_path / "w.pth")
    with pytest.raises(SegmenterError, match="has changed since this run was planned"):
        load_weights(network(1), tmp_path / "w.pth", "small", "0" * 64)


def test_names_of_early_versions_mean_nothing(tmp_path: Path) -> None:
    old = ("backbone.layer1.0.conv1.weight", "fpn.downsample_layers.2.bias", "fpn.downsample_layers.3.weight")
    kept = (
        "backbone.layers.0.0.conv1.weight",
        "fpn.downsample_layers.1.bias",
        "fpn.lat_layers.2.bias",
        "backbone.layerx.1",
    )
    assert [current_name(name) for name in (*old, *kept)] == [None, None, None, *kept]
    torch.save({**network(1).state_dict(), **dict.fromkeys(old, torch.zeros(1))}, tmp_path / "w.pth")
    target = network(2)
    load(target, tmp_path / "w.pth", rename=current_name)
    assert torch.equal(target[0].weight, network(1)[0].weight)
