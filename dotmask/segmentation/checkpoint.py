"""Weights from files: tensors alone, never code, and exactly those that a network has."""

import hashlib
import io
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path

import torch
from safetensors.torch import load as tensors_from_safetensors
from torch import Tensor, nn

from dotmask.errors import SegmenterError


def load_weights(
    network: nn.Module, path: Path, name: str, sha256: str, rename: Callable[[str], str | None] = lambda old: old
) -> None:
    """Fill a network with the tensors of a file.

    The file must hold every tensor of the network, by name and shape, and no other.

    Args:
        network: keeps its own element types.
        path: a `.safetensors` file, or else what `torch.save` wrote of a state dict.
        name: what to call the network in messages.
        sha256: of the file, as it was when the run was planned.
        rename: from the name of a tensor in the file to that in the network; None where early versions had a tensor
            that means nothing.

    Raises:
        SegmenterError: the file cannot be read, is another one than planned, holds code or anything else than tensors,
            or is of another network; the message names the first tensor that differs.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SegmenterError(f"{path}: cannot be read ({error.strerror})") from error
    if hashlib.sha256(content).hexdigest() != sha256:
        raise SegmenterError(f"{path}: has changed since this run was planned; start it again")
    given = {new: value for old, value in _tensors(content, path).items() if (new := rename(old)) is not None}
    wanted = network.state_dict()
    _check_fit(given, wanted, f"{path}: no weights of {name}")
    network.load_state_dict(given)


def _tensors(content: bytes, path: Path) -> Mapping[str, Tensor]:
    """The tensors of a file by name; whatever else a pickle asks for is refused before it is made."""
    try:
        if path.suffix == ".safetensors":
            return tensors_from_safetensors(content)
        loaded = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except Exception as error:  # damaged bytes fail in many ways, in either library
        if isinstance(error, pickle.UnpicklingError) and "unsupported global" in str(error).lower():
            reason = "holds code or objects beside tensors, and none of it was run"
        else:
            reason = f"is no {path.suffix if path.suffix == '.safetensors' else 'PyTorch'} file, or is cut short"
        raise SegmenterError(f"{path}: {reason}; give the file that the authors published") from error
    if not isinstance(loaded, Mapping):
        raise SegmenterError(f"{path}: expected tensors by name, got {type(loaded).__name__}")
    for key, value in loaded.items():
        if not (isinstance(key, str) and isinstance(value, Tensor)):
            raise SegmenterError(f"{path}: expected tensors by name, but {key!r} is {type(value).__name__}")
    return loaded


def _check_fit(given: Mapping[str, Tensor], wanted: Mapping[str, Tensor], complaint: str) -> None:
    for key, tensor in wanted.items():
        if key not in given:
            raise SegmenterError(f"{complaint}: tensor {key} is missing")
        have = given[key]
        if have.shape != tensor.shape:
            raise SegmenterError(f"{complaint}: tensor {key} is {_size(have)}, expected {_size(tensor)}")
        if have.layout != torch.strided or have.is_quantized or have.is_floating_point() != tensor.is_floating_point():
            raise SegmenterError(f"{complaint}: tensor {key} holds {have.dtype}, expected {tensor.dtype}")
        if not torch.isfinite(have).all():
            raise SegmenterError(f"{complaint}: tensor {key} holds a number that is not finite")
    for key in given:
        if key not in wanted:
            raise SegmenterError(f"{complaint}: it has no tensor {key}")


def _size(tensor: Tensor) -> str:
    return "x".join(str(n) for n in tensor.shape) or "scalar"
