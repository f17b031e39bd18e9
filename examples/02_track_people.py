"""Run the method on a scenario frame by frame and print what it believes of each object beside the truth.

python examples/02_track_people.py [FRAMES]
"""

import sys

import numpy as np

from dotmask.pipeline import ClosedLoop, DotMask
from dotmask.profiles import profile
from dotmask.slam.embedded import EmbeddedSlam
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from scenarios.oracle import OracleSegmenter
from scenarios.registry import scenario
from scenarios.world import build_simulator

frames = int(sys.argv[1]) if len(sys.argv) > 1 else 60

simulator = build_simulator(scenario("smoke"), "numba", threads=2)
oracle = OracleSegmenter()  # put your own segmenter here: an object with segment(frame) -> Detections
start = simulator.frame(0).truth.T_world_camera
slam = EmbeddedSlam(intrinsics_from_camera(simulator.camera), start)  # or your own: see dotmask.interfaces.SlamBackend
loop = ClosedLoop(DotMask(oracle, profile("calibrated")), slam, "refined", start)

for index in range(frames):
    sim_frame = simulator.frame(index)
    oracle.show(index, sim_frame.truth)
    result = loop.step(rgbd_frame_from_sim(sim_frame))
    if index % 10 == 9:
        for track in result.front_end.tracks:
            verdict = track.verdict
            assert verdict is not None
            print(
                f"{sim_frame.timestamp_s:4.1f} s  {track.class_name:7s} {track.track_id}  "
                f"{np.linalg.norm(track.velocity_world):.2f} m/s  {'moving' if verdict.is_moving else 'idle'} "
                f"({verdict.reason.value})"
            )
