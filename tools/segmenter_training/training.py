"""The loop: batches of changed frames, the loss of YOLACT, AdamW, cycles of the learning rate, averaged weights."""

import csv
import io
import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import torch
from safetensors.torch import save
from torch import Tensor

from dotmask.atomic_file import write_atomically
from dotmask.segmentation.yolact.anchors import anchors_of
from dotmask.segmentation.yolact.design import COMPACT, YolactDesign
from dotmask.segmentation.yolact.images import colour_channels, depth_channel
from dotmask.segmentation.yolact.loss import Losses, Target, yolact_loss
from dotmask.segmentation.yolact.network import Answer, Yolact
from sim.randomness import child
from tools.segmenter_training.augmentation import changed, draw_change, target_of
from tools.segmenter_training.errors import TrainingError
from tools.segmenter_training.frames import LabelledFrame
from tools.segmenter_training.state import (
    AveragedWeights,
    Settings,
    optimiser_tensors,
    read_state,
    restore_optimiser,
    write_state,
)
from tools.segmenter_training.team import Team, team

WEIGHTS, LOSSES = "compact.safetensors", "losses.csv"
WARM_UP = 0.05
"""Share of the first cycle in which the learning rate grows."""
FIRST_FOUND = 0.02
"""At the beginning an anchor stands for something with this probability: else those without a box drown the others."""
LAST_RATE = 0.01
"""The learning rate at the end of a cycle, as a share of the largest."""
WEIGHT_DECAY = 0.02
LARGEST_GRADIENT = 10.0
"""Gradients with a larger norm are scaled down to it."""
LOG_EVERY = 20
"""Steps of which the mean loss is written."""


class Frames(Protocol):
    """Frames by number."""

    def __len__(self) -> int:
        """How many there are."""
        ...

    def __getitem__(self, index: int) -> LabelledFrame:
        """Frame `index`."""
        ...


def learning_rate(step: int, settings: Settings) -> float:
    """Of step `step`, counted from 0: once up along a line, and in each cycle down along a cosine.

    Warm restarts after Loshchilov and Hutter, SGDR (ICLR 2017), equation 5: the second and later cycles begin with
    the largest rate at once.
    """
    cycle, place = divmod(step, settings.steps)
    rising = max(1, round(WARM_UP * settings.steps)) if cycle == 0 else 0
    if place < rising:
        return settings.peak_rate * (place + 1) / rising
    share = (place - rising) / max(1, settings.steps - rising)
    return settings.peak_rate * (LAST_RATE + (1 - LAST_RATE) * (1 + math.cos(math.pi * share)) / 2)


def frames_of_step(step: int, frames: int, settings: Settings) -> list[int]:
    """Which frames step `step` sees: each epoch goes through all frames in an order of its own."""
    chosen = []
    for visit in range(step * settings.batch, (step + 1) * settings.batch):
        epoch, place = divmod(visit, frames)
        chosen.append(int(child(settings.seed, "segmenter epoch", epoch).permutation(frames)[place]))
    return chosen


def train(
    frames: Frames,
    settings: Settings,
    folder: Path,
    *,
    save_every: int,
    advance: Callable[[int, str], None],
    design: YolactDesign = COMPACT,
    stop_after: int | None = None,
) -> float:
    """Train, or go on where an earlier call was stopped, and write WEIGHTS and LOSSES to `folder`.

    A training that was stopped and continued gives the same weights as one that was not.

    Args:
        frames: of the network's size.
        settings: what decides the weights.
        folder: of the training.
        save_every: steps after which the state is written.
        advance: called with the number of new steps, and with the loss in words.
        design: of the network.
        stop_after: end after so many steps in all without finishing, as if killed; None to finish.

    Returns:
        Wall time of the training in seconds, of all calls.

    Raises:
        TrainingError: the state is damaged or of other settings, or the loss is no number any more.
    """
    last = settings.all_steps if stop_after is None else min(stop_after, settings.all_steps)
    values = sum(parameter.numel() for parameter in Yolact(design).parameters()) + len(Losses._fields)
    with team(settings.processes, values, _help, frames, settings, folder, design, last) as mine:
        return _learn(mine, frames, settings, folder, design, last, save_every, advance)


def _help(mine: Team, frames: Frames, settings: Settings, folder: Path, design: YolactDesign, last: int) -> None:
    """What the other processes do: the same steps, without a word."""
    cv2.setNumThreads(1)
    _learn(mine, frames, settings, folder, design, last, None, lambda steps, told: None)


def _learn(
    mine: Team,
    frames: Frames,
    settings: Settings,
    folder: Path,
    design: YolactDesign,
    last: int,
    save_every: int | None,
    advance: Callable[[int, str], None],
) -> float:
    """The steps of one process; state, losses and weights are written only if it knows when to (`save_every`)."""
    torch.set_num_threads(1)
    device = torch.device(settings.device)
    torch.manual_seed(settings.seed)
    network = Yolact(design).to(device).to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    _expect_background(network)
    optimiser = torch.optim.AdamW(_parameter_groups(network), lr=settings.peak_rate, fused=True)
    averaged = AveragedWeights(network)
    anchors = anchors_of(design).to(device)
    first, earlier_s, rows = 0, 0.0, []
    state = read_state(folder, settings)
    if state is not None:
        first, earlier_s, parts = state
        network.load_state_dict(parts["network"])
        averaged.tensors = {name: tensor.to(device) for name, tensor in parts["average"].items()}
        restore_optimiser(optimiser, parts["optimiser"])
        rows = [row for row in _read_losses(folder / LOSSES) if int(row[0]) <= first]
        advance(first, "continued")
    mine.wait()  # all have read before one writes
    start_s, recent = time.perf_counter(), []
    for step, (images, targets) in _batches(mine, frames, settings, design, range(first, last)):
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(step, settings)
        torch.manual_seed(int(child(settings.seed, "segmenter step", step, mine.rank).integers(2**31)))
        seen = [_on(target, device) for target in targets]
        losses = _step(mine, network, optimiser, images.to(device), seen, anchors, settings)
        told = [float(part) for part in losses]
        if not math.isfinite(sum(told)):
            raise TrainingError(f"step {step}: the loss is no number any more; begin anew with a smaller --rate")
        if save_every is None:
            continue
        averaged.see(network, step)
        recent.append(told)
        done = step + 1
        if done % LOG_EVERY == 0 or done == last:
            means = [sum(column) / len(recent) for column in zip(*recent, strict=True)]
            rows.append([str(done), *(f"{mean:.5f}" for mean in (*means, sum(means)))])
            recent = []
        advance(1, f"loss {sum(told):.2f}")
        if done % save_every == 0 or done == settings.all_steps:
            seconds = earlier_s + time.perf_counter() - start_s
            _write_losses(folder / LOSSES, rows)
            write_state(
                folder,
                settings,
                done,
                seconds,
                {
                    "network": network.state_dict(),
                    "average": averaged.tensors,
                    "optimiser": optimiser_tensors(optimiser),
                },
            )
    if last == settings.all_steps and save_every is not None:
        weights = {name: tensor.detach().cpu().contiguous() for name, tensor in averaged.tensors.items()}
        write_atomically(folder / WEIGHTS, save(weights))
    return earlier_s + time.perf_counter() - start_s if first < last else earlier_s


def _step(
    mine: Team,
    network: Yolact,
    optimiser: torch.optim.Optimizer,
    images: Tensor,
    targets: list[Target],
    anchors: Tensor,
    settings: Settings,
) -> Losses:
    with torch.autocast(images.device.type, torch.bfloat16, enabled=settings.precision == "bfloat16"):
        answer = network(images)
    answer = Answer(*(part.float() for part in answer))
    losses = yolact_loss(answer, targets, anchors)
    optimiser.zero_grad()
    torch.stack(tuple(losses)).sum().backward()  # type: ignore[no-untyped-call]
    losses = Losses(*(part.detach() for part in losses))
    mine.average([*(p.grad for p in network.parameters() if p.grad is not None), *losses])
    torch.nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
    optimiser.step()
    return losses


def _expect_background(network: Yolact) -> None:
    """Set the biases of the classes so that the network finds nearly nothing at first (Lin et al., section 4.1)."""
    layer = network.prediction_layers[0].conf_layer
    classes = network.semantic_seg_conv.out_channels
    with torch.no_grad():
        layer.bias.view(-1, classes + 1)[:] = 0.0
        layer.bias.view(-1, classes + 1)[:, 0] = math.log(classes * (1 - FIRST_FOUND) / FIRST_FOUND)


def _parameter_groups(network: Yolact) -> list[dict[str, object]]:
    """Weights of convolutions decay; biases and norms do not."""
    heavy = [p for p in network.parameters() if p.ndim > 1]
    light = [p for p in network.parameters() if p.ndim <= 1]
    return [{"params": heavy, "weight_decay": WEIGHT_DECAY}, {"params": light, "weight_decay": 0.0}]


def _batches(
    mine: Team, frames: Frames, settings: Settings, design: YolactDesign, steps: range
) -> Iterator[tuple[int, tuple[Tensor, list[Target]]]]:
    """The batches of the steps; the next one is made while the network learns from this one."""
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(_batch, mine, frames, settings, design, steps[0]) if len(steps) else None
        for step in steps:
            assert waiting is not None
            batch = waiting.result()
            waiting = pool.submit(_batch, mine, frames, settings, design, step + 1) if step + 1 in steps else None
            yield step, batch


def _batch(
    mine: Team, frames: Frames, settings: Settings, design: YolactDesign, step: int
) -> tuple[Tensor, list[Target]]:
    """Images (B, 4, H, W) of this process's share of a step, normalised, and what is to be found in them."""
    made, targets = [], []
    places = list(enumerate(frames_of_step(step, len(frames), settings)))
    for place, index in places[mine.rank :: len(mine)]:
        rng = child(settings.seed, "segmenter change", step * settings.batch + place)
        frame = changed(frames[index], draw_change(rng, design.height, design.width), rng)
        made.append(frame)
        targets.append(target_of(frame))
    return network_images(made), targets


def network_images(frames: Sequence[LabelledFrame]) -> Tensor:
    """Frames of the network's size (B, 4, H, W) as `dotmask.segmentation.yolact.images.network_image` makes each."""
    colours = torch.from_numpy(np.stack([frame.rgb for frame in frames])).permute(0, 3, 1, 2).float()
    depths_m = torch.from_numpy(np.stack([frame.depth_mm for frame in frames]).astype(np.float32) / 1000)
    images = torch.cat([colour_channels(colours), depth_channel(depths_m[:, None])], dim=1)
    return images.contiguous(memory_format=torch.channels_last)


def _on(target: Target, device: torch.device) -> Target:
    return Target(boxes=target.boxes.to(device), classes=target.classes.to(device), masks=target.masks.to(device))


def _read_losses(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]


def _write_losses(path: Path, rows: list[list[str]]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([["step", *Losses._fields, "sum"], *rows])
    write_atomically(path, text.getvalue())
