"""Names of the COCO data set (Lin et al., "Microsoft COCO: common objects in context", ECCV 2014)."""

from collections.abc import Mapping
from types import MappingProxyType

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

KEYPOINTS = (
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
)

SKELETON = (
    (16, 14), (14, 12), (17, 15), (15, 13), (12, 13), (6, 12), (7, 13), (6, 7), (6, 8), (7, 9),
    (8, 10), (9, 11), (2, 3), (1, 2), (1, 3), (2, 4), (3, 5), (4, 6), (5, 7),
)  # fmt: skip
"""Limbs as pairs of keypoint numbers from 1, as in COCO's own `person_keypoints` files."""


def supercategory(category_id: int) -> str:
    """The group that COCO puts a category into."""
    return next(name for ids, name in SUPERCATEGORIES.items() if category_id in ids)
