"""Files that come with the method; scripts in `tools/` made them."""

from pathlib import Path


def asset_places(name: str) -> tuple[Path, ...]:
    """Where the file `name` may lie: beside the package in `assets/` of a checkout, in `dotmask_assets/` of a wheel."""
    beside = Path(__file__).resolve().parents[1]
    return beside / "assets" / name, beside / "dotmask_assets" / name


def asset_file(name: str) -> Path | None:
    """The file `name`, for example "slam/vocabulary.npz"; None where it is missing."""
    return next((path for path in asset_places(name) if path.is_file()), None)
