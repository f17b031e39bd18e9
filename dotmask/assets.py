"""Files that come with the method; scripts in `tools/` made them."""

from pathlib import Path


def asset_places(name: str) -> tuple[Path, ...]:
    """Where the file `name` may lie: in `assets/` beside the package in a checkout, in `dotmask/_assets` of a wheel."""
    package = Path(__file__).resolve().parent
    return package.parent / "assets" / name, package / "_assets" / name


def asset_file(name: str) -> Path | None:
    """The file `name`, for example "slam/vocabulary.npz"; None where it is missing."""
    return next((path for path in asset_places(name) if path.is_file()), None)
