"""What the people look like: shape, colours, clothes. Data only. Colours are sRGB, 0..255."""

from dataclasses import dataclass

Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outfit:
    """Clothes of one character.

    Attributes:
        pattern: of the shirt: "plaid", "jersey_stripe", "stripe" or "floral".
        colours: of the pattern, its ground first.
        has_collar: a shirt with collar and buttons, else a round neckline.
        trousers: colour.
        is_denim: jeans, else plain cloth with a crease.
        shoes, soles: colours.
    """

    pattern: str
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
        has_stubble: shaved beard.
        has_long_hair: to the shoulders, else short.
        seed: of all its noise.
        outfits: by name, the default one first.
    """

    phenotype: dict[str, float]
    changes: dict[str, float]
    skin: Colour
    lips: Colour
    hair: Colour
    iris: Colour
    has_stubble: bool
    has_long_hair: bool
    seed: int
    outfits: dict[str, Outfit]


STYLES = {
    "man": Style(
        phenotype={"gender": 0.0, "age": 0.55, "muscle": 0.55, "weight": 0.45, "height": 0.55, "proportions": 0.7},
        changes={
            "mouth-angles-up": 0.4,
            "l-eye-height2-incr": -0.3,
            "r-eye-height2-incr": -0.3,
            "chin-width-incr": 0.2,
        },
        skin=(222, 172, 142),
        lips=(178, 104, 96),
        hair=(62, 42, 30),
        iris=(74, 92, 96),
        has_stubble=True,
        has_long_hair=False,
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
        phenotype={"gender": 1.0, "age": 0.5, "muscle": 0.5, "weight": 0.45, "height": 0.58, "proportions": 0.8},
        changes={"mouth-angles-up": 0.5, "l-eye-height2-incr": -0.2, "r-eye-height2-incr": -0.2},
        skin=(208, 156, 126),
        lips=(172, 84, 84),
        hair=(104, 68, 40),
        iris=(84, 62, 40),
        has_stubble=False,
        has_long_hair=True,
        seed=2,
        outfits={
            "stripes": Outfit(
                pattern="stripe",
                colours=((228, 226, 218), (44, 60, 108)),
                has_collar=False,
                trousers=(88, 88, 94),
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
}
