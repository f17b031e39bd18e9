"""Write the table of movable things in docs/things.md.

python -m tools.things_table
"""

from pathlib import Path

import numpy as np

from sim.things.movables import KINDS, Movable, movable
from tools.doc_block import markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "things.md"
HEADER = ["kind", "look", "class", "size, m", "mass, kg", "friction", "rolling, mm", "triangles"]


def row(kind: str, look: str, made: Movable) -> list[str]:
    """One line of the table."""
    vertices = np.concatenate([surface.vertices for surface in made.surfaces])
    size = " x ".join(f"{extent:.2f}" for extent in np.ptp(vertices, axis=0))
    body = made.body
    rolling = f"{1e3 * body.rolling_m:.1f}" if body.rolling_m else "-"
    triangles = str(sum(len(surface.faces) for surface in made.surfaces))
    return [kind, look, kind, size, f"{body.total_mass_kg:.2f}", f"{body.friction:g}", rolling, triangles]


def main() -> None:
    """Make everything once and write the table."""
    rows = [row(kind, look, movable(kind, look, 0)) for kind, (_, looks) in KINDS.items() for look in looks]
    write_block(PAGE, "things", "python -m tools.things_table", markdown_table(HEADER, rows))


if __name__ == "__main__":
    main()
