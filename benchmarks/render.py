"""The renderer against its peers, and a crowd through the whole simulator. Prints a table in Markdown.

    python -m benchmarks.render [--frames 20] [--write docs/rendering.md]

The peers draw the meshes of the office with two walking people as they are at time 0, without shadows: less work than
ours. Frames of all alternate, so that the machine's load is the same for each. CPU time is that of all threads.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks.peers import PeerMissingError, Pyrender, TinyRenderer
from scenarios.registry import scenario
from scenarios.world import build_simulator
from sim.records import Moment
from sim.renderers.visibility_buffer import VisibilityBufferRenderer
from tools.doc_block import markdown_table, write_block

OFFICE, CROWD = "fr3_walking_xyz", "crowd"
WARM_UP_FRAMES = 2
BUDGET_MS, CROWD_FRAMES, CROWD_BUDGET_S = 30.0, 60, 4.0
TARGETS: dict[type[TinyRenderer | Pyrender], float] = {TinyRenderer: 3.0, Pyrender: 10.0}
"""How many times our CPU time each peer should need at least."""
COMMAND = "python -m benchmarks.render --write docs/rendering.md"
HEADER = ["renderer: colour, depth, ids", "CPU ms", "times ours", "target"]


def _quartiles(seconds: list[float]) -> tuple[float, str]:
    """Median, and median with the middle half of the values, in milliseconds."""
    low, middle, high = 1e3 * np.percentile(seconds[WARM_UP_FRAMES:], [25, 50, 75])
    return float(middle), f"{middle:.1f} ({low:.1f} to {high:.1f})"


def compare(frames: int) -> str:
    """The table of renderers, and a line on what was drawn."""
    simulator = build_simulator(scenario(OFFICE), "numba", 1)
    renderer = VisibilityBufferRenderer(simulator.scene, simulator.camera)
    triangles = sum(len(s.faces) for o in simulator.scene.objects for s in o.surfaces)
    peers: list[TinyRenderer | Pyrender] = []
    missing: list[list[str]] = []
    for kind in TARGETS:
        try:
            peers.append(kind(simulator.scene, simulator.camera))
        except PeerMissingError as error:
            missing.append([kind.name, f"not measured: {error}", "", f"at least {TARGETS[kind]:.0f}"])
    moments: list[Moment] = [simulator.moment(simulator.time_s(n)) for n in range(frames + WARM_UP_FRAMES)]
    ours: list[float] = []
    theirs: list[list[float]] = [[] for _ in peers]
    for moment in moments:
        start = time.process_time()
        renderer.render(moment)
        ours.append(time.process_time() - start)
        for peer, seconds in zip(peers, theirs, strict=True):
            start = time.process_time()
            peer.draw(moment.T_world_camera)
            seconds.append(time.process_time() - start)
    median, stated = _quartiles(ours)
    camera = simulator.camera
    drawn = f"{camera.width}x{camera.height}, {triangles} triangles, {frames} frames, CPU ms per frame (middle half):"
    rows = [["ours, soft shadows, edges anti-aliased", stated, "1", f"at most {BUDGET_MS:.0f} ms"]]
    for peer, seconds in zip(peers, theirs, strict=True):
        other, stated = _quartiles(seconds)
        rows.append([peer.name, stated, f"{other / median:.1f}", f"at least {TARGETS[type(peer)]:.0f}"])
    return f"{drawn}\n\n{markdown_table(HEADER, rows + missing)}"


def crowd() -> str:
    """One line on a crowd through the whole simulator: rendering, truth and sensor."""
    simulator = build_simulator(scenario(CROWD), "numba", 2)
    for index in range(WARM_UP_FRAMES):
        simulator.frame(index)
    start, cpu_start = time.perf_counter(), time.process_time()
    for index in range(CROWD_FRAMES):
        simulator.frame(index)
    seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
    people = sum(actor.class_name == "person" for actor in simulator.scene.actors)
    return (
        f"{CROWD_FRAMES} frames of {people} people with truth and sensor, 2 threads: {cpu_seconds:.2f} s of CPU time, "
        f"{seconds:.2f} s on the clock (target: at most {CROWD_BUDGET_S:.0f} s on the clock of an idle machine)"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the table into this page")
    options = parser.parse_args()
    text = f"{compare(options.frames)}\n\n{crowd()}"
    print(text)
    if options.write:
        write_block(options.write, "speed", COMMAND, text)


if __name__ == "__main__":
    main()
