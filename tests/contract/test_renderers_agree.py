"""Two renderers that share no code for projection, rasterisation and texture filtering draw the same images.

Skipped where no OpenGL library is found; `.ci/run` installs one.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from scenarios.registry import RENDERED_AS, SCENARIOS
from scenarios.world import RENDERERS, build_simulator
from sim.renderers.pyrender_renderer.gl_context import RendererMissingError, choose_platform

try:
    choose_platform()
except RendererMissingError as error:
    pytest.skip(f"no OpenGL here: {error}", allow_module_level=True)

DEPTH_M, SHARE = 0.002, 0.999
"""So large a share of the pixels agrees in depth within DEPTH_M, and in instance id."""

SAME_NORMAL, NORMAL_SHARE = np.cos(np.radians(1.0)), 0.995
"""The second renderer takes normals from differences inside blocks of 2x2 pixels, which rounds those seen edge-on."""

COLOUR_LEVELS = 4.0
"""Bound of the mean difference of colour, in grey levels of 256."""

QUICK = ("smoke", "crowd", "tilted")
"""Drawn in every run; the others take long and wait for `make test-all`."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in sorted(set(RENDERED_AS.values()))],
)
def test_depth_ids_and_colour_agree_in_every_scenario(name: str) -> None:
    simulator = build_simulator(SCENARIOS[name], "numba", 1)
    renderer, judge = (RENDERERS[r](simulator.scene, simulator.camera, 1) for r in ("numba", "pyrender"))
    for index in (0, len(simulator) // 2, len(simulator) - 1):
        moment = simulator.moment(simulator.time_s(index))
        ours, theirs = renderer.render(moment, normals=True), judge.render(moment, normals=True)
        depth = np.abs(ours.depth_m - theirs.depth_m) < DEPTH_M
        ids = ours.instance_ids == theirs.instance_ids
        levels = float(np.abs(ours.rgb.astype(np.int16) - theirs.rgb).mean())
        assert ours.normals_camera is not None
        assert theirs.normals_camera is not None
        normals = (ours.normals_camera * theirs.normals_camera).sum(axis=2) > SAME_NORMAL
        said = (
            f"frame {index}: depth {depth.mean():.5f}, ids {ids.mean():.5f}, normals {normals.mean():.5f}, "
            f"colour {levels:.2f}"
        )
        print(name, said)
        assert depth.mean() >= SHARE, said
        assert ids.mean() >= SHARE, said
        assert normals.mean() >= NORMAL_SHARE, said
        assert levels < COLOUR_LEVELS, said
        for actor in simulator.scene.actors:
            alone = renderer.unoccluded_pixels(actor.name)
            assert judge.unoccluded_pixels(actor.name) == pytest.approx(alone, rel=0.005, abs=10), actor.name


def test_the_command_line_renders_with_the_second_one(dotmask: Callable[..., Any], tmp_path: Path) -> None:
    for renderer in ("numba", "pyrender"):
        done = dotmask("render", "smoke", "--frames", 2, "--renderer", renderer, "--out", tmp_path / renderer)
        assert done.code == 0, done.err
    depth, other = (cv2.imread(str(min((tmp_path / r / "depth").glob("*.png"))), -1) for r in ("numba", "pyrender"))
    assert depth.dtype == np.uint16
    assert (np.abs(depth.astype(int) - other) <= 10).mean() > SHARE  # at 5000 per metre: 2 mm
