"""Who stands near the camera and reaches above its horizon is a person."""

import cv2
import numpy as np

NEAR_M = 2.8
HORIZON_ROW = 100
TALL_PX = 5
MARGIN_PX = 11


def people(rgb, depth_m, stamp_s):
    """Pixels (H, W) to hide, from colour (H, W, 3) uint8, depth (H, W) metres with 0 = no return, and seconds."""
    is_near = (depth_m > 0) & (depth_m < NEAR_M)
    is_tall = is_near[:HORIZON_ROW].sum(axis=0) > TALL_PX
    hidden = (is_near & is_tall).astype(np.uint8)
    return cv2.dilate(hidden, np.ones((MARGIN_PX, MARGIN_PX), np.uint8)) > 0
