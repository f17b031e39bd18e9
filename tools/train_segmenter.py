"""Train the network `compact`: render, learn, test on what was held out, write weights and model card.

The same command goes on where it was stopped or killed. Examples::

    python -m tools.train_segmenter --publish        # all of it, and the result into assets/
    python -m tools.train_segmenter --out /tmp/tiny --scenes 3 --frames-a-scene 8 --steps 40 --batch 4 --test 2
"""

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import torch

from dotmask.atomic_file import write_atomically
from dotmask.errors import DotmaskError
from dotmask.segmentation.networks import WEIGHTS_OF_COMPACT
from dotmask.segmentation.yolact.design import COMPACT
from dotmask.segmentation.yolact.network import Yolact
from scenarios.cli.display import progress_bar
from scenarios.errors import ScenarioError
from scenarios.segmenter_evaluation.report import SegmenterEvaluation
from scenarios.segmenter_evaluation.run import frames_of
from scenarios.spec import Scenario, first_frames
from sim.errors import SimError
from tools.asset_files import update_manifest
from tools.segmenter_training import held_out
from tools.segmenter_training.card import CARD, Facts, card, hardware
from tools.segmenter_training.errors import TrainingError
from tools.segmenter_training.frames import FRAMES_A_SCENE, FrameStore
from tools.segmenter_training.pictures import SHEET, write_curve, write_sheet
from tools.segmenter_training.state import Settings
from tools.segmenter_training.training import WEIGHTS, train

ASSETS = Path(__file__).parent.parent / "assets"
RENDERING, RESULTS = "rendering.json", "results.json"
SAVE_EVERY = 200
LARGEST_BYTES = 12_000_000


def main() -> None:
    """Do what is asked for, and say in one line why if it cannot be done."""
    args = _arguments()
    cv2.setNumThreads(1)
    try:
        _run(args)
    except (DotmaskError, ScenarioError, SimError) as error:
        sys.exit(f"train_segmenter: {error}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.train_segmenter",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--out", type=Path, default=Path("runs/segmenter"), help="working folder (runs/segmenter)")
    parser.add_argument("--seed", type=int, default=0, help="of everything (0)")
    parser.add_argument("--scenes", type=int, default=720, help="random scenes that are rendered (720)")
    parser.add_argument("--frames-a-scene", type=int, default=FRAMES_A_SCENE, help=f"({FRAMES_A_SCENE})")
    parser.add_argument(
        "--cycles", type=int, default=2, help="of the learning rate; a finished training can be given more (2)"
    )
    parser.add_argument("--steps", type=int, default=12000, help="of the optimiser in each cycle (12000)")
    parser.add_argument("--batch", type=int, default=16, help="images a step (16)")
    parser.add_argument("--rate", type=float, default=1e-3, help="largest learning rate (0.001)")
    parser.add_argument("--processes", type=int, default=2, help="that render and learn; threads of the test (2)")
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto", help="auto takes CUDA if present")
    parser.add_argument(
        "--precision",
        choices=("bfloat16", "float32"),
        default="bfloat16",
        help="of the convolutions; a processor without bfloat16 is faster in float32 (bfloat16)",
    )
    parser.add_argument("--test", type=int, default=held_out.SCENARIOS, help="scenarios of the test (all)")
    parser.add_argument("--publish", action="store_true", help="put weights and card into assets/ at the end")
    args = parser.parse_args()
    for name in ("scenes", "frames_a_scene", "cycles", "steps", "batch", "processes", "test"):
        if getattr(args, name) < 1:
            parser.error(f"--{name.replace('_', '-')} must be at least 1")
    if args.batch < args.processes:
        parser.error("--batch must be at least --processes: they share it")
    if args.test > held_out.SCENARIOS:
        parser.error(f"--test must be at most {held_out.SCENARIOS}")
    if args.publish and args.test < held_out.SCENARIOS:
        parser.error("--publish needs the whole test; leave --test away")
    return args


def _run(args: argparse.Namespace) -> None:
    device = ("cuda" if torch.cuda.is_available() else "cpu") if args.device == "auto" else args.device
    if device == "cuda" and not torch.cuda.is_available():
        raise TrainingError("--device cuda: PyTorch finds no CUDA device here; use --device cpu")
    settings = Settings(
        seed=args.seed,
        scenes=args.scenes,
        frames_a_scene=args.frames_a_scene,
        cycles=args.cycles,
        steps=args.steps,
        batch=args.batch,
        peak_rate=args.rate,
        processes=1 if device == "cuda" else args.processes,  # one keeps a GPU busy
        device=device,
        precision=args.precision,
    )
    out: Path = args.out
    out.mkdir(parents=True, exist_ok=True)
    store = FrameStore(out / f"frames-{args.seed}-{args.frames_a_scene}", args.seed, args.scenes, args.frames_a_scene)
    rendering_s = _render(store, out, args.processes)
    if not (out / SHEET).exists():
        write_sheet(store, settings, out / SHEET)
    with progress_bar("steps", remembered_s=120.0) as progress:
        task = progress.add_task("learn", total=settings.all_steps)
        training_s = train(
            store,
            settings,
            out,
            save_every=SAVE_EVERY,
            advance=lambda steps, told: progress.update(task, advance=steps, description=f"learn, {told}"),
        )
    write_curve(out)
    content = (out / WEIGHTS).read_bytes()
    facts = Facts(
        settings=settings,
        rendering_s=rendering_s,
        training_s=training_s,
        hardware=hardware(settings),
        sha256=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        values=sum(parameter.numel() for parameter in Yolact(COMPACT).parameters()),
        command="python -m tools.train_segmenter --publish",
    )
    write_atomically(out / CARD, card(facts, *_evaluations(out, args, facts)))
    print(f"{out / CARD}")
    if args.publish:
        _publish(out, facts)


def _render(store: FrameStore, out: Path, processes: int) -> float:
    """Render what is missing; the wall time in seconds, of this and of earlier calls."""
    path = out / RENDERING
    seconds = float(json.loads(path.read_text(encoding="utf-8"))["seconds"]) if path.exists() else 0.0
    missing = len(store.missing())
    if not missing:
        return seconds
    before_s, start_s = seconds, time.perf_counter()
    with progress_bar("frames", remembered_s=120.0) as progress:
        task = progress.add_task("render", total=missing * store.frames_a_scene)

        def advance(frames: int) -> None:
            progress.advance(task, frames)
            told = {"seconds": before_s + time.perf_counter() - start_s}
            write_atomically(path, json.dumps(told) + "\n")

        store.render(processes, advance)
    return before_s + time.perf_counter() - start_s


def _evaluations(out: Path, args: argparse.Namespace, facts: Facts) -> tuple[SegmenterEvaluation, SegmenterEvaluation]:
    """On what was held out, and on the catalog; kept in RESULTS for the same weights and the same test."""
    path = out / RESULTS
    test = tuple(held_out.held_out_scenario(number) for number in range(args.test))
    catalog = held_out.catalog_scenarios()
    if args.test < held_out.SCENARIOS:  # a trial: a few frames of the catalog will do
        catalog = tuple(first_frames(one, 1) for one in catalog[:1])
    folder = out / "held_out"
    folder.mkdir(exist_ok=True)
    for scenario in test:
        write_atomically(folder / f"{scenario.name}.json", scenario.to_json())
    key = {"sha256": facts.sha256, "test": args.test, "threads": args.processes}
    if path.exists() and (told := json.loads(path.read_text(encoding="utf-8")))["key"] == key:
        first, second = (SegmenterEvaluation.model_validate(told[name]) for name in ("held_out", "catalog"))
        return first, second
    first = _judged("held out", out, args, facts, test, held_out.EVERY)
    second = _judged("catalog", out, args, facts, catalog, held_out.CATALOG_EVERY)
    told = {"key": key, "held_out": json.loads(first.to_json()), "catalog": json.loads(second.to_json())}
    write_atomically(path, json.dumps(told, indent=2) + "\n")
    return first, second


def _judged(
    name: str, out: Path, args: argparse.Namespace, facts: Facts, scenarios: Sequence[Scenario], every: int
) -> SegmenterEvaluation:
    with progress_bar() as progress:
        task = progress.add_task(f"test, {name}", total=sum(len(frames_of(one, every)) for one in scenarios))
        return held_out.evaluate(
            out / WEIGHTS, facts.settings.device, args.processes, scenarios, every, lambda: progress.advance(task)
        )


def _publish(out: Path, facts: Facts) -> None:
    """Weights, card and manifest into the assets."""
    if facts.size_bytes > LARGEST_BYTES:
        raise TrainingError(f"{out / WEIGHTS}: has {facts.size_bytes} bytes, more than the {LARGEST_BYTES} allowed")
    target = ASSETS / WEIGHTS_OF_COMPACT
    target.parent.mkdir(exist_ok=True)
    write_atomically(target, (out / WEIGHTS).read_bytes())
    write_atomically(target.with_name(CARD), (out / CARD).read_text(encoding="utf-8"))
    settings = facts.settings
    update_manifest(
        ASSETS,
        WEIGHTS_OF_COMPACT,
        source="made by tools/train_segmenter",
        licence="CC0-1.0",
        changes=f"trained for {settings.all_steps} steps of {settings.batch} images on "
        f"{settings.scenes * settings.frames_a_scene} frames of random scenes, seed {settings.seed}; see compact.md",
    )
    print(f"{target}")


if __name__ == "__main__":
    main()
