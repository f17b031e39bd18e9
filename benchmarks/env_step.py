"""CPU time of a step of CameraDrive at 320x240, one thread. Prints a table in Markdown.

python -m benchmarks.env_step [--steps 60] [--write]
"""

import argparse
import os
import time
from pathlib import Path

import gymnasium
import numpy as np

from scenarios.envs import ENTRY_POINTS
from tools.doc_block import markdown_table, write_block

PAGE = Path("docs/gym.md")
COMMAND = "python -m benchmarks.env_step --write"
WARM_UP_STEPS = 6
TARGET_MS = 25


def measured_ms(method: str, steps: int) -> np.ndarray:
    """(steps,) CPU milliseconds of this process, every step of a slow weaving drive through `smoke`."""
    drive = next(name for name in ENTRY_POINTS if "CameraDrive" in name)
    env = gymnasium.make(drive, scenario="smoke", overrides={"frames": steps + WARM_UP_STEPS + 1}, method=method)
    env.reset(seed=0)
    took = []
    for step in range(steps + WARM_UP_STEPS):
        action = np.array([0.1 * np.sin(step / 9), 0, 0.1, 0, 0.2 * np.sin(step / 7), 0], np.float32)
        start = time.process_time()
        env.step(action)
        took.append(1e3 * (time.process_time() - start))
    return np.array(took[WARM_UP_STEPS:])


def main() -> None:
    """Measure each method and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE}")
    arguments = parser.parse_args()
    rows = []
    for method in ("unmasked", "mdi", "dotmask"):
        took = measured_ms(method, arguments.steps)
        low, middle, high = np.percentile(took, (25, 50, 75))
        rows.append([f"`{method}`", f"{middle:.1f} ({low:.1f} to {high:.1f})", f"{TARGET_MS}"])
    table = markdown_table(["method", "CPU ms a step (middle half)", "target"], rows)
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    text = f"`smoke` at 320x240, {arguments.steps} steps, {load}:\n\n{table}"
    print(text)
    if arguments.write:
        write_block(PAGE, "env-step", COMMAND, text)


if __name__ == "__main__":
    main()
