"""Names of the COCO data set (Lin et al., "Microsoft COCO: common objects in context", ECCV 2014)."""

from collections.abc import Mapping
from types import MappingProxyType

from sim.people.keypoints import SKELETON_LINKS

CATEGORY_IDS: Mapping[str, int] = MappingProxyType(
    {
        "person": 1,
        "backpack": 27,
        "umbrella": 28,
        "handbag": 31,
        "suitcase": 33,
        "sports ball": 37,
        "bottle": 44,
        "wine glass": 46,
        "cup": 47,
        "fork": 48,
        "knife": 49,
        "spoon": 50,
        "bowl": 51,
        "chair": 62,
        "couch": 63,
        "potted plant": 64,
        "bed": 65,
        "dining table": 67,
        "tv": 72,
        "laptop": 73,
        "mouse": 74,
        "remote": 75,
        "keyboard": 76,
        "cell phone": 77,
        "microwave": 78,
        "refrigerator": 82,
        "book": 84,
        "clock": 85,
        "vase": 86,
        "scissors": 87,
        "teddy bear": 88,
    }
)
"""Category ids of what may stand in a room. A class that is not here (a box, a shelf) is no COCO class."""

SUPERCATEGORIES: Mapping[range, str] = MappingProxyType(
    {
        range(1, 2): "person",
        range(27, 34): "accessory",
        range(34, 44): "sports",
        range(44, 52): "kitchen",
        range(62, 72): "furniture",
        range(72, 78): "electronic",
        range(78, 84): "appliance",
        range(84, 92): "indoor",
    }
)

SKELETON = tuple((a + 1, b + 1) for a, b in SKELETON_LINKS)
"""Limbs as pairs of keypoint numbers from 1, as in COCO's own `person_keypoints` files."""


def supercategory(category_id: int) -> str:
    """The group that COCO puts a category into."""
    return next(name for ids, name in SUPERCATEGORIES.items() if category_id in ids)
