"""Render one frame of a scenario and write its colour, depth and truth as pictures.

python examples/01_render_a_frame.py [SCENARIO] [FRAME]
"""

import sys
from pathlib import Path

from scenarios.registry import scenario
from scenarios.video import depth_panel, write_picture
from scenarios.world import build_simulator

name = sys.argv[1] if len(sys.argv) > 1 else "smoke"
index = int(sys.argv[2]) if len(sys.argv) > 2 else 30

simulator = build_simulator(scenario(name), "numba", threads=2)
frame = simulator.frame(index)  # any frame alone: it does not depend on the others

write_picture(Path(f"{name}_{index}_colour.png"), frame.rgb)
write_picture(Path(f"{name}_{index}_depth.png"), depth_panel(frame.depth_m))
for actor in frame.truth.objects:
    x, y, z = actor.centre_world
    print(
        f"{actor.name:12s} at ({x:+.2f}, {y:+.2f}, {z:.2f}) m, {'moves' if actor.is_moving else 'idle '}, "
        f"{actor.visible_pixels} pixels, {100 * actor.occlusion:.0f} % hidden"
    )
