"""The networks by name. PyTorch is loaded only when one of them is asked for."""

import hashlib
import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dotmask.assets import asset_file
from dotmask.errors import SegmenterError
from dotmask.interfaces import Segmenter

if TYPE_CHECKING:
    from torch import nn

NETWORKS = ("compact", "mask_rcnn", "yolact", "yolact++")
DEVICES = ("cpu", "cuda")

WEIGHTS_OF_COMPACT = "segmenter/compact.safetensors"
"""The asset; `tools/train_segmenter.py` makes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkChoice:
    """Which network runs with which weights, where.

    Attributes:
        name: of `NETWORKS`.
        weights: the file.
        weights_sha256: of it.
        device: of `DEVICES`.
    """

    name: str
    weights: Path
    weights_sha256: str
    device: str


def choose_network(name: str, weights: Path | None, device: str) -> NetworkChoice:
    """A network that can run here.

    Args:
        name: of `NETWORKS`.
        weights: the file; None for the one that comes with `compact`, and of `mask_rcnn` for the one that torchvision
            has downloaded before.
        device: of `DEVICES`.

    Raises:
        SegmenterError: a package, the device or the file is missing.
    """
    _check_installed(name)
    import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise SegmenterError("--device cuda: PyTorch finds no CUDA device here; use --device cpu")
    chosen = _own_weights(name) if weights is None else weights
    try:
        with chosen.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise SegmenterError(f"{chosen}: cannot be read ({error.strerror}); --weights names the file") from error
    return NetworkChoice(name=name, weights=chosen, weights_sha256=digest, device=device)


def load_network(choice: NetworkChoice) -> Segmenter:
    """The network with its weights.

    Raises:
        SegmenterError: see `dotmask.segmentation.checkpoint.load_weights`.
    """
    import torch

    from dotmask.segmentation.checkpoint import load_weights

    device = torch.device(choice.device)
    network: nn.Module
    if choice.name == "mask_rcnn":
        from dotmask.segmentation.mask_rcnn import MaskRcnnSegmenter, current_name, mask_rcnn

        network = mask_rcnn()
        load_weights(network, choice.weights, choice.name, choice.weights_sha256, current_name)
        return MaskRcnnSegmenter(network, device)
    from dotmask.segmentation.yolact.design import COMPACT, YOLACT, YOLACT_PLUS
    from dotmask.segmentation.yolact.network import Yolact, current_name
    from dotmask.segmentation.yolact.segmenter import YolactSegmenter

    design = {"yolact": YOLACT, "yolact++": YOLACT_PLUS, "compact": COMPACT}[choice.name]
    network = Yolact(design)
    load_weights(network, choice.weights, choice.name, choice.weights_sha256, current_name)
    return YolactSegmenter(network, design, device)


def pytorch() -> str:
    """Which PyTorch networks run on here.

    Raises:
        SegmenterError: none is installed.
    """
    _check_installed("yolact")
    import torch

    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "no CUDA"
    return f"PyTorch {torch.__version__}, {device}"


@contextmanager
def network_threads(count: int) -> Iterator[None]:
    """PyTorch works with so many threads inside the block."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _check_installed(name: str) -> None:
    needed = {"torch": "nn", "safetensors": "nn"} | ({"torchvision": "torchvision"} if name == "mask_rcnn" else {})
    for package, extra in needed.items():
        if importlib.util.find_spec(package) is None:
            raise SegmenterError(f"--segmenter {name}: {package} is not installed; run pip install 'dotmask[{extra}]'")
    if name == "mask_rcnn":
        try:
            import torchvision  # noqa: F401
        except (ImportError, RuntimeError) as error:
            raise SegmenterError(
                f"--segmenter mask_rcnn: torchvision does not work with the installed PyTorch ({error}); install the "
                "two versions that belong together"
            ) from error


def _own_weights(name: str) -> Path:
    if name == "compact":
        shipped = asset_file(WEIGHTS_OF_COMPACT)
        if shipped is None:
            raise SegmenterError(
                f"--segmenter compact: this version comes without its weights ({WEIGHTS_OF_COMPACT} of the assets); "
                "name a file with --weights, or make one with python -m tools.train_segmenter"
            )
        return shipped
    if name != "mask_rcnn":
        raise SegmenterError(f"--segmenter {name}: no weights come with it; name a file with --weights")
    from dotmask.segmentation.mask_rcnn import PUBLISHED, cached_weights

    path = cached_weights()
    if not path.is_file():
        raise SegmenterError(
            f"--segmenter mask_rcnn: torchvision has not downloaded its weights to {path}; fetch {PUBLISHED.url} and "
            "name the file with --weights"
        )
    return path
