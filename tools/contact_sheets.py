"""Render a contact sheet of every scenario: some frames spread over it, as the perfect sensor sees them.

Examples::

    python -m tools.contact_sheets                  # all, and their list in docs/scenarios.md
    python -m tools.contact_sheets crowd --out /tmp # one, somewhere else; docs/scenarios.md stays
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from scenarios.registry import RENDERED_AS, SCENARIOS, scenario
from scenarios.spec import Scenario
from scenarios.world import build_simulator
from tools.doc_block import write_block

DOCS = Path(__file__).parent.parent / "docs"
COLUMNS, ROWS = 4, 2
TILE_PX = (256, 192)
TITLE_PX = 22
JPEG_QUALITY = 80


def sheet(chosen: Scenario) -> npt.NDArray[np.uint8]:
    """(H, W, 3) RGB: COLUMNS x ROWS frames from the first to the last, with their times."""
    simulator = build_simulator(chosen, "numba", 1)
    tiles = []
    for index in np.linspace(0, len(simulator) - 1, COLUMNS * ROWS).round().astype(int).tolist():
        images, _ = simulator.render(index)
        tile = cv2.resize(images.rgb, TILE_PX, interpolation=cv2.INTER_AREA)
        _write(tile, f"{simulator.time_s(index):.1f} s", (5, TILE_PX[1] - 7))
        tiles.append(tile)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    title = np.full((TITLE_PX, COLUMNS * TILE_PX[0], 3), 40, np.uint8)
    _write(title, f"{chosen.name}   {chosen.frames} frames, {chosen.duration_s:.1f} s", (6, 15))
    return np.vstack([title, *rows])


def _write(image: npt.NDArray[np.uint8], text: str, place_px: tuple[int, int]) -> None:
    """White text with a dark border."""
    for colour, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(image, text, place_px, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, thickness, cv2.LINE_AA)


def listing() -> str:
    """Markdown: every scenario with its sheet, or with the name of the one whose frames it shares."""
    parts = []
    for name, chosen in SCENARIOS.items():
        first = RENDERED_AS[name]
        frames = f"![{name}](contact_sheets/{name}.jpg)" if first == name else f"The frames are those of `{first}`."
        parts.append(f"### `{name}`\n\n{chosen.description}\n\n{frames}")
    return "\n\n".join(parts)


def main() -> None:
    """Render the sheets that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenarios; all if none is named")
    parser.add_argument("--out", type=Path, default=DOCS / "contact_sheets", help="folder of the sheets")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or dict.fromkeys(RENDERED_AS.values()):
        image = cv2.cvtColor(sheet(scenario(name)), cv2.COLOR_RGB2BGR)
        path = arguments.out / f"{name}.jpg"
        if not cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]):
            raise OSError(f"{path}: cannot be written")
        print(path)
    if not arguments.names:
        write_block(DOCS / "scenarios.md", "sheets", "python -m tools.contact_sheets", listing())


if __name__ == "__main__":
    main()
