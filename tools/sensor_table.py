"""Write the table of the sensors' parameters in docs/sensor.md.

Example::

    python -m tools.sensor_table
"""

from dataclasses import fields
from pathlib import Path

from sim.sensor.model import SensorModel
from sim.sensor.parameters import SENSORS, Sensor
from sim.sensor.timing import Timing
from tools.doc_block import write_block

PAGE = Path(__file__).parent.parent / "docs" / "sensor.md"


def parameter_table() -> str:
    """Markdown: the values of every set, then the source of every number."""
    sections = [_values()]
    sections += [_sources(name, sensor) for name, sensor in SENSORS.items() if sensor.sources]
    return "\n".join(sections)


def _names() -> list[str]:
    return [field.name for record in (SensorModel, Timing) for field in fields(record)]


def _value(sensor: Sensor, name: str) -> str:
    record = sensor.model if hasattr(sensor.model, name) else sensor.timing
    return f"{getattr(record, name):.6g}"


def _values() -> str:
    lines = [f"| parameter | {' | '.join(SENSORS)} |", f"|---|{'---|' * len(SENSORS)}"]
    lines += [f"| `{name}` | {' | '.join(_value(s, name) for s in SENSORS.values())} |" for name in _names()]
    return "\n".join(lines) + "\n"


def _sources(name: str, sensor: Sensor) -> str:
    lines = [f"| `{name}` | value | source |", "|---|---|---|"]
    lines += [f"| `{field}` | {_value(sensor, field)} | {sensor.sources.get(field, '')} |" for field in _names()]
    return "\n".join(line for line in lines if not line.endswith("|  |")) + "\n"


def main() -> None:
    """Write the table."""
    write_block(PAGE, "sensors", "python -m tools.sensor_table", parameter_table())


if __name__ == "__main__":
    main()
