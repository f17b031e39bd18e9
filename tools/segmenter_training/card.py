"""The model card: what the network was taught with, how, on what, and how well it does; written from facts alone."""

import platform
from dataclasses import dataclass
from pathlib import Path

import torch

from dotmask.segmentation.yolact.design import COMPACT
from scenarios.oracle import MIN_PIXELS
from scenarios.registry import SCENARIOS
from scenarios.segmenter_evaluation.report import CIRCUMSTANCES, SegmenterEvaluation
from scenarios.segmenter_evaluation.sightings import REASONABLE_HEIGHT_PX, REASONABLE_OCCLUSION
from sim.things.chairs import CHAIR_COLOURS
from tools.doc_block import markdown_table
from tools.segmenter_training import held_out, split
from tools.segmenter_training.augmentation import LEAST_PX, MASK_SHARE
from tools.segmenter_training.frames import SENSOR_NAMES
from tools.segmenter_training.state import AveragedWeights, Settings
from tools.segmenter_training.training import LARGEST_GRADIENT, LAST_RATE, WARM_UP, WEIGHT_DECAY

CARD = "compact.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What the card says beside the results.

    Attributes:
        settings: of the training.
        rendering_s, training_s: wall time.
        hardware: what it ran on.
        sha256: of the weights.
        size_bytes: of their file.
        values: number of trained values.
        command: that does it again.
    """

    settings: Settings
    rendering_s: float
    training_s: float
    hardware: str
    sha256: str
    size_bytes: int
    values: int
    command: str


def hardware(settings: Settings) -> str:
    """The processor or GPU, and the version of PyTorch."""
    if settings.device == "cuda":
        return f"{torch.cuda.get_device_name()}, PyTorch {torch.__version__}"
    cpuinfo = Path("/proc/cpuinfo")
    names = [
        line.partition(":")[2].strip()
        for line in (cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.is_file() else [])
        if line.startswith("model name")
    ]
    return f"{settings.processes} core(s) of {names[0] if names else platform.machine()}, PyTorch {torch.__version__}"


def card(facts: Facts, on_held_out: SegmenterEvaluation, on_catalog: SegmenterEvaluation) -> str:
    """The card in Markdown."""
    s = facts.settings
    frames, mask_px = s.scenes * s.frames_a_scene, f"{COMPACT.width // MASK_SHARE}x{COMPACT.height // MASK_SHARE}"
    sensors = " or ".join(f"`{name}`" for name in SENSOR_NAMES)
    return f"""# `compact`: model card

Written by `{facts.command}`; no figure here was typed by hand.

YOLACT's design on a small backbone and with finer prototypes (`dotmask/segmentation/yolact`),
{facts.values / 1e6:.2f} million values, for {_listed(split.CLASSES)}; it is given colour and depth,
stretched to {COMPACT.width}x{COMPACT.height}. Weights: `compact.safetensors`,
{facts.size_bytes / 1e6:.1f} MB, float32, CC0-1.0, SHA-256
`{facts.sha256}`.

For rendered scenarios. It has never seen a photograph: on recorded folders take a network that was trained on them.

## Data

{frames} frames of {s.scenes} random scenes, {s.frames_a_scene} each, rendered by the project's own simulator with the
true masks, seen through {sensors}, and halved to {COMPACT.width}x{COMPACT.height}; seed {s.seed}.
Every frame draws who is there, doing what, where, and from where the camera looks: 0.2 to 1.8 m high, mostly upright,
often rolled up to 35 degrees, seldom at any angle. Every scene draws its room, furniture and lamps, the colours and
patterns of clothes, skin, chairs, things and walls, the focal length and the exposure. While the network learns,
frames are mirrored, zoomed, turned and shifted, their colours changed, blurred along a line and made noisy; the depth
of some lies beside the colour, and some have none. To be found are all people, chairs, cups and bottles with at least
{LEAST_PX} pixels of {COMPACT.width}x{COMPACT.height}, cut or hidden as they are, those that belong to the furniture
too.

{_split(s)}

The shapes of chairs, cups and bottles, and the kinds of furniture, are the same on both sides; a random colour of the
training may be near a held-out one. Scenarios of the catalog with none of the training's people and chairs:
{_catalog(is_seen=False)}. With some: {_catalog(is_seen=True)}.

## Training

{s.all_steps} steps of {s.batch} images ({s.all_steps * s.batch / frames:.1f} times each frame), AdamW. The learning
rate has {s.cycles} {"cycle" if s.cycles == 1 else "cycles"} of {s.steps} steps; in each it falls along a cosine from
{s.peak_rate:g} to {100 * LAST_RATE:g} % of it, after a warm-up in the first {100 * WARM_UP:g} % of the first cycle;
weight decay {WEIGHT_DECAY:g}, gradients cut at a norm of {LARGEST_GRADIENT:g}; convolutions in {s.precision}, the rest
in float32. Published are averaged weights (decay {AveragedWeights.LONGEST:g}). It began with random weights.
On {facts.hardware}: {facts.rendering_s / 60:.0f} minutes to render, {facts.training_s / 60:.0f} minutes to train. The
same settings on the same processor give the same weights.

## Results on what was held out

{_results(on_held_out)}

The frames are {sum(on_held_out.scenarios.values())} of {len(on_held_out.scenarios)} scenarios of random casts, places
and camera paths in the five rooms of the catalog, {held_out.EVERY / 30:g} s apart, through the noise of either sensor,
a quarter with motion blur and rolling shutter. An instance is to be found if it shows at least {MIN_PIXELS} pixels of
640x480, however much of it is hidden; cups and bottles of the furniture count neither as found nor as wrong.
Reasonable is AP50 of the instances alone that show at least {REASONABLE_HEIGHT_PX} rows of pixels and are hidden at
most to {100 * REASONABLE_OCCLUSION:g} %, the setting in which detectors of pedestrians are compared (Dollár et al.,
TPAMI 2012); the others count neither as found nor as wrong. Small,
medium and large are COCO's, by visible pixels: fewer than 1024, fewer than 9216, and more.

{_misses(on_held_out)}

## Results on scenarios of the catalog

{_listed(tuple(on_catalog.scenarios))}, every {held_out.CATALOG_EVERY}th frame.

{_results(on_catalog)}

## Limits

It knows the people, chairs, cups and bottles of this simulator alone. Where a camera gives no depth at all it finds
much less: few frames of the training were so. Masks have {mask_px} pixels: the rims of
small things are coarse. How often it misses what is small, far, rolled, cut or blurred is said above.
"""


def _split(settings: Settings) -> str:
    colours = tuple(colour for colour in CHAIR_COLOURS if colour not in split.HELD_OUT_CHAIR_COLOURS)
    return markdown_table(
        ["", "training", "held out for the test"],
        [
            [
                "characters",
                *(f"{_listed(n)}, all outfits" for n in (split.TRAINING_CHARACTERS, split.HELD_OUT_CHARACTERS)),
            ],
            [
                "chairs",
                f"{_listed(colours)}, all shapes, half of the parts in other colours",
                f"{_listed(split.HELD_OUT_CHAIR_COLOURS)}, all shapes",
            ],
            ["rooms", "random ones (`tools/train_vocabulary/rooms.py`)", _listed(split.HELD_OUT_ROOMS)],
            ["seeds", f"{settings.seed}, and below 1000000", f"{split.FIRST_HELD_OUT_SEED} and more"],
            ["cups, bottles", "all looks, half of the parts in other colours", "no look is held out, all seeds are"],
        ],
    )


def _catalog(*, is_seen: bool) -> str:
    """Scenarios with people, by whether the training had some of what they show."""
    return _listed(
        tuple(
            f"`{name}`"
            for name, chosen in SCENARIOS.items()
            if chosen.people.cast and bool(split.seen_in_training(chosen)) == is_seen
        )
    )


def _results(evaluation: SegmenterEvaluation) -> str:
    rows = []
    for name, f in evaluation.classes.items():
        numbers = (f.ap50, f.ap50_reasonable, f.ap50_small, f.ap50_medium, f.ap50_large, f.ap, f.iou)
        counts = (str(f.seen), str(f.reasonable))
        rows.append([name, *(_number(value) for value in numbers), *counts, _percent(f.missed_share)])
    header = ["class", "AP50", "reasonable", "small", "medium", "large", "AP", "IoU of the found"]
    header += ["to be found", "reasonable ones", "missed, %"]
    table = markdown_table(header, rows)
    ms = evaluation.ms
    assert ms.median is not None
    assert ms.p95 is not None
    where = f"{ms.threads} thread(s)" if evaluation.segmenter.device == "cpu" else str(evaluation.segmenter.device)
    times = f"{ms.median:.1f} ms in the median, {ms.p95:.1f} ms in the 95th percentile"
    return f"{table}\n\nTime a frame, 640x480: {times}, on {where}."


def _misses(evaluation: SegmenterEvaluation) -> str:
    rows = [
        [CIRCUMSTANCES[circumstance], band.label, str(band.seen), _percent(band.missed_share)]
        for circumstance, bands in evaluation.misses.items()
        for band in bands
    ]
    return markdown_table(["missed by", "", "to be found", "missed, %"], rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f}"


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(names)
