"""Command line: `python -m tools.bake_humans [NAME ...] [--out assets]`, from the root of the repository."""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tools.asset_files import update_manifest, write_npz
from tools.bake_humans.body import Body, extract_body
from tools.bake_humans.cloth_paint import paint_collar, paint_shirt, paint_shoes, paint_trousers
from tools.bake_humans.clothes import Tailor
from tools.bake_humans.hair import make_hair, paint_hair
from tools.bake_humans.head import make_eyes, make_skin
from tools.bake_humans.mesh import Array, Mesh
from tools.bake_humans.store import CHANGES, LICENCE, SOURCE, Part, character_arrays
from tools.bake_humans.styles import STYLES, Outfit, Style
from tools.bake_humans.texture import bake_map, fill, unwrap

SIZES = {"skin": 1024, "shirt": 1024, "trousers": 1024, "collar": 256, "shoes": 512, "hair": 256}

MAX_FACES = 15_000
"""Of a person in any outfit."""

Paint = Callable[[Array, Outfit], Array]


def clothe(name: str, mesh: Mesh, paint: Paint, outfits: dict[str, Outfit]) -> Part:
    """Unwrap a garment and paint it for each outfit."""
    cut, uv, weld = unwrap(mesh)
    mapped, mask = bake_map(cut.vertices, cut.faces, uv, SIZES[name])
    points = mapped[mask]
    textures = {key: fill(paint(points, outfit), mask) for key, outfit in outfits.items()}
    return Part(name=name, mesh=cut, uv=uv, weld=weld, textures=textures)


def dress(body: Body, style: Style) -> list[Part]:
    """All parts of the character."""
    tailor, seed, outfits = Tailor(body, style.seed), style.seed, style.outfits
    shirt = tailor.shirt()
    with_collar = {key: outfit for key, outfit in outfits.items() if outfit.has_collar}
    skin, eyes = make_skin(body, style, SIZES["skin"]), make_eyes(body, style)
    hair, hair_uv, hair_normals = make_hair(body, style)
    return [
        Part(name="skin", mesh=skin.mesh, uv=skin.uv, weld=skin.weld, textures={"": skin.texture}),
        Part(name="eyes", mesh=eyes.mesh, uv=eyes.uv, weld=eyes.weld, textures={"": eyes.texture}),
        Part(
            name="hair",
            mesh=hair,
            uv=hair_uv,
            normals=hair_normals,
            weld=np.arange(len(hair.vertices)),
            textures={"": paint_hair(style, SIZES["hair"])},
        ),
        clothe("shirt", shirt, lambda p, o: paint_shirt(p, tailor, o, seed), outfits),
        clothe("collar", tailor.collar(shirt), lambda p, o: paint_collar(p, o, seed), with_collar),
        clothe("trousers", tailor.trousers(), lambda p, o: paint_trousers(p, tailor, o, seed), outfits),
        clothe("shoes", tailor.shoes(), lambda p, o: paint_shoes(p, tailor, o, seed), outfits),
    ]


def main() -> None:
    """Bake the characters that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m tools.bake_humans", description=__doc__)
    parser.add_argument("characters", nargs="*", metavar="CHARACTER", help=", ".join(STYLES))
    parser.add_argument("--out", type=Path, default=Path("assets"), help="the asset folder (default: assets)")
    args = parser.parse_args()
    if unknown := set(args.characters) - set(STYLES):
        parser.error(f"no style for {', '.join(sorted(unknown))}; known: {', '.join(STYLES)}")
    for name in args.characters or STYLES:
        start = time.perf_counter()
        body = extract_body(STYLES[name].phenotype, STYLES[name].changes)
        parts = dress(body, STYLES[name])
        for outfit in STYLES[name].outfits:
            worn = sum(len(p.mesh.faces) for p in parts if p.textures.keys() & {"", outfit})
            if worn > MAX_FACES:
                raise SystemExit(f"{name} in {outfit} has {worn} triangles, at most {MAX_FACES} are allowed")
        file = f"humans/{name}.npz"
        write_npz(args.out / file, character_arrays(body, parts, list(STYLES[name].outfits)))
        update_manifest(args.out, file, source=SOURCE, licence=LICENCE, changes=CHANGES)
        print(
            f"{name}: {sum(len(p.mesh.faces) for p in parts)} triangles, "
            f"{(args.out / file).stat().st_size / 1e6:.2f} MB, {time.perf_counter() - start:.0f} s"
        )


if __name__ == "__main__":
    main()
