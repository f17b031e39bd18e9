"""The parameter sets: complete, sourced, and as the documentation prints them."""

from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import pytest

from scenarios.spec import Scenario, SensorSpec
from scenarios.world import build_simulator
from sim.sensor.model import SensorModel
from sim.sensor.parameters import IDEAL, SENSORS
from sim.sensor.timing import Timing

PAGE = Path(__file__).parents[2] / "docs" / "sensor.md"


def test_a_scenario_may_name_every_set_and_no_other() -> None:
    assert set(get_args(SensorSpec.model_fields["model"].annotation)) == set(SENSORS)


def test_the_ideal_sensor_has_no_error() -> None:
    assert (IDEAL.model, IDEAL.timing) == (SensorModel(), Timing())
    assert IDEAL.timing.is_instant


@pytest.mark.parametrize("name", [n for n in SENSORS if n != "ideal"])
def test_every_number_has_a_source_and_every_error_acts(name: str) -> None:
    sensor = SENSORS[name]
    values = {f.name: getattr(r, f.name) for r in (sensor.model, sensor.timing) for f in fields(r)}
    assert set(sensor.sources) == {field for field, value in values.items() if value != 0}
    assert set(values) - set(sensor.sources) <= {"axial_slant_m"}
    assert sum("assumed" not in source for source in sensor.sources.values()) >= 10


def test_errors_in_time_act_only_when_asked_for() -> None:
    sensor = SENSORS["realsense_d435"]
    for motion_errors, expected in ((False, replace(sensor, timing=Timing())), (True, sensor)):
        spec = SensorSpec(model="realsense_d435", motion_errors=motion_errors)
        chosen = Scenario(name="empty_room", description="nobody", sensor=spec)
        assert build_simulator(chosen, "numba", 1).sensor == expected
