"""Stored values, for what has no analytic answer: they notice a change that nobody meant.

`python tests/golden/regenerate.py` writes them anew.
"""

import importlib.util
import json
from pathlib import Path

import pytest

from scenarios.registry import RENDERED_AS, SCENARIOS

HERE = Path(__file__).parent
_spec = importlib.util.spec_from_file_location("regenerate", HERE / "regenerate.py")
regenerate = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(regenerate)


def stored(name: str) -> dict:
    return json.loads((HERE / f"{name}.json").read_text())


def test_every_scenario_has_a_stored_frame() -> None:
    assert sorted(stored("frame_hashes")) == sorted(SCENARIOS)


def test_scenarios_that_share_their_frames_share_the_stored_one() -> None:
    hashes = stored("frame_hashes")
    assert {name: hashes[first] for name, first in RENDERED_AS.items()} == hashes


@pytest.mark.parametrize("name", sorted(set(RENDERED_AS.values())))
def test_a_frame_has_the_bytes_it_had(name: str) -> None:
    assert regenerate.frame_hash(name) == stored("frame_hashes")[name]


def test_a_frame_looks_as_it_did() -> None:
    expected, measured = stored("smoke_frame"), regenerate.frame_statistics()
    # Half a grey level and a few pixels: what another version of a library may change without anybody seeing it.
    assert measured["mean_rgb"] == pytest.approx(expected["mean_rgb"], abs=0.5)
    assert measured["depth_quartiles_m"] == pytest.approx(expected["depth_quartiles_m"], abs=0.005)
    assert measured["share_without_depth"] == pytest.approx(expected["share_without_depth"], abs=0.002)
    assert measured["visible_pixels"] == pytest.approx(expected["visible_pixels"], abs=20)


def test_trajectory_errors_are_as_they_were() -> None:
    assert regenerate.trajectory_figures() == pytest.approx(stored("trajectory"), rel=1e-9)
