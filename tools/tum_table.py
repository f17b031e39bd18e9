"""Compare the camera's motion with the TUM RGB-D benchmark, and write the table of docs/scenarios.md.

Example::

    python -m tools.tum_table
"""

from pathlib import Path

from scenarios.registry import scenario
from scenarios.tum_figures import BENCHMARK, CameraFigures, camera_figures
from tools.doc_block import markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "scenarios.md"
HEADER = [
    "sequence",
    "duration, s",
    "benchmark",
    "length, m",
    "benchmark",
    "speed, m/s",
    "benchmark",
    "turning, deg/s",
    "benchmark",
    "largest difference",
]


def row(name: str, ours: CameraFigures, theirs: CameraFigures) -> list[str]:
    """One line of the table."""
    cells, largest = [f"`{name}`"], 0.0
    for field, digits in (("duration_s", 1), ("length_m", 2), ("speed_m_s", 3), ("turn_deg_s", 1)):
        one, other = getattr(ours, field), getattr(theirs, field)
        cells += [f"{one:.{digits}f}", f"{other:.{digits}f}"]
        largest = max(largest, abs(one / other - 1))
    return [*cells, f"{100 * largest:.0f} %"]


def main() -> None:
    """Measure, print and write the table."""
    rows = [row(name, camera_figures(scenario(name)), theirs) for name, theirs in BENCHMARK.items()]
    table = markdown_table(HEADER, rows)
    print(table)
    write_block(PAGE, "tum", "python -m tools.tum_table", table)


if __name__ == "__main__":
    main()
