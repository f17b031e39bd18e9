"""The office with two dressed people at 640x480: our renderer against pybullet's TinyRenderer, CPU time, one thread.

    python benchmarks/render_office.py [--frames 20]

The peer draws the same meshes, posed as at time 0 and without textures or shadows: less work than ours. Frames of the
two alternate, so that the machine's load is the same for both.
"""

import argparse
import time

import numpy as np
import pybullet

from scenarios.registry import scenario
from scenarios.world import build_simulator
from sim.geometry import inverse
from sim.humans import skin
from sim.records import CameraModel
from sim.simulator import Simulator

NEAR_M, FAR_M = 0.1, 20.0


def load_into_bullet(simulator: Simulator) -> int:
    """A pybullet client with every surface of the scene as it is at time 0."""
    client = pybullet.connect(pybullet.DIRECT)
    for thing in simulator.scene.objects:
        palette = thing.motion.palette_at(0.0)
        for surface in thing.surfaces:
            bones = surface.bones if surface.bones is not None else np.zeros((len(surface.vertices), 1), np.int32)
            weights = (
                surface.weights if surface.weights is not None else np.ones((len(surface.vertices), 1), np.float32)
            )
            vertices = skin(surface.vertices, bones, weights, palette)
            shape = pybullet.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=vertices.tolist(),
                indices=surface.faces.ravel().tolist(),
                physicsClientId=client,
            )
            pybullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=client)
    return client


def projection(camera: CameraModel) -> list[float]:
    """OpenGL's projection matrix (column order) of the pinhole camera."""
    a, b = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    rows = [
        [2 * camera.fx / camera.width, 0, 1 - 2 * (camera.cx + 0.5) / camera.width, 0],
        [0, 2 * camera.fy / camera.height, 2 * (camera.cy + 0.5) / camera.height - 1, 0],
        [0, 0, a, b],
        [0, 0, -1, 0],
    ]
    return list(np.array(rows).T.ravel())


def main() -> None:
    """Time both and print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=20)
    frames = parser.parse_args().frames
    simulator = build_simulator(scenario("fr3_walking_xyz"), "numba", 1)
    client = load_into_bullet(simulator)
    camera = simulator.camera
    triangles = sum(len(s.faces) for o in simulator.scene.objects for s in o.surfaces)
    ours, theirs = [], []
    for index in range(frames + 2):
        start = time.process_time()
        _, T_world_camera, _ = simulator.render(index)
        ours.append(time.process_time() - start)
        view = np.diag([1.0, -1, -1, 1]) @ inverse(T_world_camera)
        start = time.process_time()
        pybullet.getCameraImage(
            camera.width,
            camera.height,
            list(view.T.ravel()),
            projection(camera),
            renderer=pybullet.ER_TINY_RENDERER,
            shadow=0,
            physicsClientId=client,
        )
        theirs.append(time.process_time() - start)
    a, b = (1e3 * float(np.median(t[2:])) for t in (ours, theirs))
    print(f"{triangles} triangles, {frames} frames, CPU ms per frame (median)")
    print(f"visibility buffer, shadows {a:7.1f}")
    print(f"pybullet TinyRenderer      {b:7.1f}   ratio {b / a:.1f}")
    pybullet.disconnect(client)


if __name__ == "__main__":
    main()
