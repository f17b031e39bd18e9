"""What the people look like: shape, colours, clothes. Data only. Colours are sRGB, 0..255."""

from dataclasses import dataclass
from typing import Literal

Colour = tuple[int, int, int]
Pattern = Literal["plaid", "gingham", "oxford", "jersey_stripe", "stripe", "floral", "dots", "knit"]
HairCut = Literal["short", "cropped", "long", "ponytail"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outfit:
    """Clothes of one character.

    Attributes:
        pattern: of the shirt.
        colours: of the pattern, its ground first.
        has_collar: a shirt with collar and buttons, else a round neckline.
        trousers: colour.
        is_denim: jeans, else plain cloth with a crease.
        shoes, soles: colours.
    """

    pattern: Pattern
    colours: tuple[Colour, ...]
    has_collar: bool
    trousers: Colour
    is_denim: bool
    shoes: Colour
    soles: Colour


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """One character.

    Attributes:
        phenotype, changes: see `extract_body`.
        skin, lips, hair, iris: colours.
        hair_cut: "short" is combed to the side, "cropped" is short and curly, "long" reaches the shoulders.
        beard: how dense, 0..1.
        brow_m, lash_m: how thick the brows are, and the dark rim of the lids.
        seed: of all its noise.
        outfits: by name, the default one first.
    """

    phenotype: dict[str, float]
    changes: dict[str, float]
    skin: Colour
    lips: Colour
    hair: Colour
    iris: Colour
    hair_cut: HairCut
    beard: float
    brow_m: float
    lash_m: float
    seed: int
    outfits: dict[str, Outfit]

    @property
    def is_combed_down(self) -> bool:
        """Hair that lies on the head or hangs, not one that stands up."""
        return self.hair_cut in ("long", "ponytail")


STYLES = {
    "man": Style(
        phenotype={"gender": 0.0, "age": 0.67, "muscle": 0.55, "weight": 0.48, "height": 0.35, "proportions": 0.7},
        changes={
            "mouth-angles-up": 0.4,
            "chin-width-incr": 0.2,
            "l-eye-height2-incr": -0.3,
            "r-eye-height2-incr": -0.3,
        },
        skin=(222, 172, 142),
        lips=(178, 104, 96),
        hair=(62, 42, 30),
        iris=(74, 92, 96),
        hair_cut="short",
        beard=0.22,
        brow_m=0.0046,
        lash_m=0.0018,
        seed=1,
        outfits={
            "plaid": Outfit(
                pattern="plaid",
                colours=((168, 46, 44), (36, 34, 58), (232, 216, 188)),
                has_collar=True,
                trousers=(66, 88, 130),
                is_denim=True,
                shoes=(74, 50, 38),
                soles=(226, 222, 212),
            ),
            "green": Outfit(
                pattern="jersey_stripe",
                colours=((62, 116, 84), (224, 226, 214), (40, 84, 62)),
                has_collar=False,
                trousers=(52, 50, 56),
                is_denim=False,
                shoes=(44, 46, 54),
                soles=(210, 208, 204),
            ),
        },
    ),
    "woman": Style(
        phenotype={"gender": 1.0, "age": 0.66, "muscle": 0.5, "weight": 0.44, "height": 0.421, "proportions": 0.8},
        changes={
            "mouth-angles-up": 0.6,
            "neck-scale-horiz-incr": -0.25,
            "l-eye-scale-incr": 0.2,
            "r-eye-scale-incr": 0.2,
            "chin-prominent-incr": -0.2,
            "chin-width-incr": -0.45,
            "mouth-upperlip-volume-incr": 0.3,
            "mouth-lowerlip-volume-incr": 0.3,
            "nose-scale-horiz-incr": -0.2,
            "l-eye-height2-incr": -0.1,
            "r-eye-height2-incr": -0.1,
        },
        skin=(214, 164, 134),
        lips=(176, 84, 84),
        hair=(98, 64, 38),
        iris=(84, 62, 40),
        hair_cut="long",
        beard=0.0,
        brow_m=0.0031,
        lash_m=0.0024,
        seed=2,
        outfits={
            "stripes": Outfit(
                pattern="stripe",
                colours=((228, 226, 218), (44, 60, 108)),
                has_collar=False,
                trousers=(44, 46, 66),
                is_denim=False,
                shoes=(150, 52, 50),
                soles=(232, 230, 224),
            ),
            "blouse": Outfit(
                pattern="floral",
                colours=((236, 200, 120), (190, 66, 74), (60, 104, 92), (250, 240, 222)),
                has_collar=True,
                trousers=(54, 78, 128),
                is_denim=True,
                shoes=(230, 226, 220),
                soles=(206, 186, 156),
            ),
        },
    ),
    "tall_man": Style(
        phenotype={"gender": 0.0, "age": 0.74, "muscle": 0.68, "weight": 0.62, "height": 0.46, "proportions": 0.75},
        changes={
            "mouth-angles-up": 0.3,
            "chin-width-incr": 0.4,
            "nose-scale-horiz-incr": 0.35,
            "nose-flaring-incr": 0.3,
            "mouth-lowerlip-volume-incr": 0.4,
            "mouth-upperlip-volume-incr": 0.3,
            "l-eye-height2-incr": -0.2,
            "r-eye-height2-incr": -0.2,
        },
        skin=(138, 92, 66),
        lips=(128, 76, 68),
        hair=(26, 22, 22),
        iris=(58, 40, 28),
        hair_cut="cropped",
        beard=0.75,
        brow_m=0.005,
        lash_m=0.002,
        seed=3,
        outfits={
            "oxford": Outfit(
                pattern="oxford",
                colours=((176, 202, 228), (244, 246, 248)),
                has_collar=True,
                trousers=(176, 152, 112),
                is_denim=False,
                shoes=(96, 60, 38),
                soles=(60, 44, 34),
            ),
            "sweater": Outfit(
                pattern="knit",
                colours=((204, 158, 58), (168, 122, 40), (228, 190, 100)),
                has_collar=False,
                trousers=(52, 66, 98),
                is_denim=True,
                shoes=(236, 236, 234),
                soles=(190, 60, 50),
            ),
        },
    ),
    "short_woman": Style(
        phenotype={"gender": 1.0, "age": 0.69, "muscle": 0.45, "weight": 0.58, "height": 0.304, "proportions": 0.6},
        changes={
            "mouth-angles-up": 0.4,
            "chin-width-incr": -0.5,
            "chin-prominent-incr": -0.3,
            "neck-scale-horiz-incr": -0.35,
            "l-eye-scale-incr": 0.3,
            "r-eye-scale-incr": 0.3,
            "mouth-lowerlip-volume-incr": 0.4,
            "nose-scale-horiz-incr": -0.1,
            "l-cheek-volume-incr": 0.3,
            "r-cheek-volume-incr": 0.3,
        },
        skin=(232, 186, 160),
        lips=(192, 84, 84),
        hair=(108, 56, 36),
        iris=(70, 98, 84),
        hair_cut="ponytail",
        beard=0.0,
        brow_m=0.0032,
        lash_m=0.0024,
        seed=4,
        outfits={
            "gingham": Outfit(
                pattern="gingham",
                colours=((240, 240, 236), (24, 96, 112)),
                has_collar=True,
                trousers=(44, 44, 52),
                is_denim=False,
                shoes=(60, 46, 44),
                soles=(214, 206, 194),
            ),
            "dots": Outfit(
                pattern="dots",
                colours=((172, 40, 58), (246, 238, 230), (120, 24, 40)),
                has_collar=False,
                trousers=(78, 104, 150),
                is_denim=True,
                shoes=(40, 44, 60),
                soles=(236, 234, 228),
            ),
        },
    ),
}
