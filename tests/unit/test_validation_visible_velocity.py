"""What is seen of a rigid thing that slides tells its velocity; of a walking person it does not."""

import pytest

from scenarios.registry import scenario
from scenarios.spec import with_overrides
from scenarios.validation.visible_velocity import table, visible_velocity


def test_every_point_of_a_sliding_chair_moves_as_its_centre_and_a_walker_swings() -> None:
    advances = []
    shown = with_overrides(scenario("smoke"), {"frames": "24"})
    chair = visible_velocity(shown, "chair", lambda: advances.append(1))
    person = visible_velocity(shown, "person", lambda: None)
    assert len(advances) == 8
    assert chair.samples > 0
    assert person.samples > 0
    # Poses are rounded to a grid of micrometres, and flow is float32: far below a millimetre in a 30th of a second.
    assert chair.mean_m_s == pytest.approx(0.0, abs=0.01)
    assert chair.median_m_s == pytest.approx(0.0, abs=0.01)
    assert person.mean_m_s is not None
    assert person.mean_m_s > 0.1
    assert "| `smoke` |" in table({"smoke": person})


def test_what_is_not_there_is_not_measured() -> None:
    nothing = visible_velocity(with_overrides(scenario("smoke"), {"frames": "4"}), "bottle", lambda: None)
    assert nothing.samples == 0
    assert nothing.mean_m_s is None
    assert table({"smoke": nothing}).endswith("| `smoke` | 0 | - | - | - |")
