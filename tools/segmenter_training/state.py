"""Where a training stands, in one file: a reader finds the old state or the new one, never half of it."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save
from torch import Tensor, nn

from dotmask.atomic_file import write_atomically
from tools.segmenter_training.errors import TrainingError

FILE = "state.safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What decides the weights.

    Attributes:
        seed: of everything.
        scenes: that are rendered.
        frames_a_scene: of each.
        cycles: of the learning rate; they do not change what earlier ones did.
        steps: of the optimiser in each cycle.
        batch: images a step.
        peak_rate: largest learning rate.
        processes: that share each batch.
        device: "cpu" or "cuda".
        precision: "bfloat16" or "float32", of the convolutions; weights, loss and optimiser are float32.
    """

    seed: int
    scenes: int
    frames_a_scene: int
    cycles: int
    steps: int
    batch: int
    peak_rate: float
    processes: int
    device: str
    precision: str

    @property
    def all_steps(self) -> int:
        """Steps of all cycles."""
        return self.cycles * self.steps


def write_state(
    folder: Path, settings: Settings, step: int, seconds: float, parts: Mapping[str, Mapping[str, Tensor]]
) -> None:
    """Replace the state in a folder.

    Args:
        folder: of the training.
        settings: of it.
        step: how many steps are done.
        seconds: wall time of the training so far.
        parts: tensors by the name of the part and their own.
    """
    tensors = {
        f"{part}/{name}": tensor.detach().cpu().contiguous()
        for part, named in parts.items()
        for name, tensor in named.items()
    }
    told = {"settings": json.dumps(asdict(settings)), "step": str(step), "seconds": repr(seconds)}
    write_atomically(folder / FILE, save(tensors, metadata=told))


def read_state(folder: Path, settings: Settings) -> tuple[int, float, dict[str, dict[str, Tensor]]] | None:
    """Steps done, wall time and tensors; None where there is no state yet.

    The state of a training with fewer cycles is an earlier state of this one.

    Raises:
        TrainingError: the file is damaged, of a training with other settings, or of one with more steps.
    """
    from safetensors import SafetensorError, safe_open

    path = folder / FILE
    if not path.exists():
        return None
    parts: dict[str, dict[str, Tensor]] = {}
    try:
        with safe_open(path, framework="pt") as file:
            told = file.metadata()
            for key in file.keys():  # noqa: SIM118 the file is no mapping
                part, _, name = key.partition("/")
                parts.setdefault(part, {})[name] = file.get_tensor(key)
        step, seconds, written = int(told["step"]), float(told["seconds"]), json.loads(told["settings"])
    except (OSError, SafetensorError, KeyError, TypeError, ValueError) as error:
        raise TrainingError(
            f"{path}: is cut short or damaged ({error}); delete it to begin the training anew, the frames stay"
        ) from error
    for name, value in asdict(settings).items():
        if name != "cycles" and written.get(name) != value:
            raise TrainingError(
                f"{path}: is of a training with {name} {written.get(name)}, not {value}; use the same options, or "
                "another --out"
            )
    if step > settings.all_steps:
        raise TrainingError(
            f"{path}: is of a training with {step} steps, more than the {settings.all_steps} asked for; use more "
            "--cycles, or another --out"
        )
    return step, seconds, parts


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """The state of an optimiser by number of the parameter and name."""
    state: Mapping[int, Mapping[str, Any]] = optimiser.state_dict()["state"]
    return {f"{number}.{name}": value for number, named in state.items() for name, value in named.items()}


def restore_optimiser(optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor]) -> None:
    """Undo `optimiser_tensors`."""
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in tensors.items():
        number, _, name = key.partition(".")
        state.setdefault(int(number), {})[name] = value
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
    for parameter, named in optimiser.state.items():
        for name, value in named.items():
            if value.shape == parameter.shape:  # in memory as the parameter is: the last bits depend on it
                named[name] = torch.empty_like(parameter).copy_(value)


class AveragedWeights:
    """The exponential average of a network's weights over the steps; what is published.

    Args:
        network: whose weights are averaged, as they are at first.
    """

    LONGEST = 0.999
    """Share of the old average in the new one, late in the training."""

    def __init__(self, network: nn.Module) -> None:
        self.tensors = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}

    def see(self, network: nn.Module, step: int) -> None:
        """Take in the weights after step `step`, counted from 0."""
        share = min(self.LONGEST, (1 + step) / (10 + step))
        for name, tensor in network.state_dict().items():
            if tensor.is_floating_point():
                self.tensors[name].lerp_(tensor, 1 - share)
            else:
                self.tensors[name].copy_(tensor)
