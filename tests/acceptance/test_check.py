"""`dotmask check` as its users meet it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from scenarios.check import run
from scenarios.check.run import CHECKS
from sim.renderers.visibility_buffer import VisibilityBufferRenderer


def test_a_table_with_a_row_for_every_check(dotmask) -> None:
    done = dotmask("check", "smoke", "--frames", 2)
    assert done.code == 0, done.out + done.err
    assert "FAILED" not in done.out
    for check in CHECKS:
        assert check.name in done.out
    widths = [len(line.rstrip()) for line in done.out.splitlines()]
    assert max(widths) < 100, "it does not fit into a terminal"


def test_json_of_two_scenarios_of_which_one_is_varied(dotmask) -> None:
    done = dotmask("check", "smoke", "fr3_sitting_static", "--frames", 1, "--set", "variant=empty", "--json")
    assert done.code == 0, done.out + done.err
    told = json.loads(done.out)
    assert [one["scenario"] for one in told] == ["smoke"] * len(CHECKS) + ["fr3_sitting_static"] * len(CHECKS)
    assert all(one["passes"] for one in told)
    assert {one["check"] for one in told if one["worst"] is None} >= {"keypoint pixels", "keypoints seen"}


def test_a_renderer_with_wrong_depth_is_found_out(dotmask, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = VisibilityBufferRenderer.render

    def wrong(renderer: VisibilityBufferRenderer, *arguments: object, **options: object) -> object:
        images = honest(renderer, *arguments, **options)
        return replace(images, depth_m=images.depth_m * np.float32(1.01))

    monkeypatch.setattr(VisibilityBufferRenderer, "render", wrong)
    done = dotmask("check", "smoke", "--frames", 1)
    assert done.code == 1
    assert "FAILED smoke, place: depth and pose put a pixel inside the box of the object" in done.err


def test_what_is_too_short_is_refused(dotmask) -> None:
    done = dotmask("check", "smoke", "--set", "frames=2")
    assert done.code == 2
    assert "at least 3 frames, this one has 2" in done.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give names of scenarios, or --all, not both"),
        (("smoke", "--all"), "give names of scenarios, or --all, not both"),
        (("smok",), "Did you mean smoke?"),
        (("smoke", "--renderer", "gpu"), "unknown renderer 'gpu'"),
        (("smoke", "--set", "nothing=1"), "unknown key 'nothing'"),
    ],
)
def test_bad_input_is_one_clear_line_and_exit_code_2(arguments: tuple[str, ...], message: str, dotmask) -> None:
    done = dotmask("check", *arguments)
    assert done.code == 2
    lines = [line for line in done.err.splitlines() if line.strip() and not line.startswith("check")]
    assert len(lines) == 1, done.err
    assert message in lines[0]
    assert done.out == ""


def test_the_checks_have_different_names() -> None:
    assert len({check.name for check in run.CHECKS}) == len(run.CHECKS)
