"""Write the table of the characters in `docs/people.md` from the assets.

python -m tools.people_table
"""

from pathlib import Path

from sim.assets import manifest
from sim.people.characters import CHARACTERS, load_character
from tools.doc_block import markdown_table, write_block

PAGE = Path(__file__).parent.parent / "docs" / "people.md"


def main() -> None:
    """One line a character."""
    rows = []
    for name, outfits in CHARACTERS.items():
        dressed = [load_character(name, outfit) for outfit in outfits]
        triangles = [sum(len(surface.faces) for surface in person.surfaces) for person in dressed]
        rows.append(
            [
                f"`{name}`",
                f"{dressed[0].height_m:.2f} m",
                ", ".join(f"`{o}` ({n:,} triangles)" for o, n in zip(outfits, triangles, strict=True)),
                f"{manifest()[f'humans/{name}.npz'].size_bytes / 1e6:.2f} MB",
            ]
        )
    table = markdown_table(["character", "height", "outfits", "file"], rows)
    write_block(PAGE, "characters", "python -m tools.people_table", table)


if __name__ == "__main__":
    main()
