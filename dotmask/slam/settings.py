"""Parameters of the embedded visual odometry."""

from dataclasses import dataclass

REFERENCE_WIDTH_PX = 640
"""Image width that the settings in pixels are meant for; they scale with the width of the camera's image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """Parameters of the frame-to-map odometry, calibrated on synthetic sequences of 640 x 480 pixels.

    Lengths in pixels hold at a width of 640 and scale with the image width.

    Attributes:
        features: at most this many corners per image.
        corner_quality: weakest corner kept, as a share of the strongest one's smaller eigenvalue.
        corner_distance_px: least distance of two corners.
        border_px: corners keep this far from pixels without depth, hence from the borders of a mask.
        max_depth_step: a corner whose surroundings differ by more than this share of its depth straddles an
            outline; its depth would be that of one side or the other.
        min_depth_m: nearer depth is not used.
        max_depth_m: further depth is not used.
        search_radius_px: first search window around where a map point is expected.
        wide_search_radius_px: second window, when the first gave no pose or far fewer inliers than before.
        max_hamming: most differing bits (of 256) of two descriptors that match.
        ratio: a match must be this much nearer than the second best in the window (Lowe 2004).
        ransac_px: inlier threshold of PnP RANSAC.
        inlier_px: most reprojection error of an inlier after refinement.
        inlier_sigmas: most depth error of an inlier after refinement, in standard deviations.
        huber: threshold of the Huber loss, pixels and standard deviations of depth.
        depth_sigma_floor_m: standard deviation of depth is `floor + growth z²`, metres ...
        depth_sigma_growth_per_m: ... growing as with a structured-light camera (Khoshelham & Elberink 2012).
        min_inliers: with fewer the frame is lost.
        relocalisation_inliers: a pose that no motion speaks for counts with at least so many inliers ...
        relocalisation_sigma_m: ... when the standard deviation of its position is no more than this; among rooms and
            places of the scenarios wrong poses have more.
        insert_below: new map points are added when fewer than this share of the features are inliers.
        map_points: at most this many points in the local map.
        fusion_depth: observations a map point's mean goes back, so that it can follow slow drift.
        keyframe_distance_m: a keyframe after this much motion ...
        keyframe_angle_rad: ... or this much rotation.
        max_keyframes: bound on memory; beyond it the most redundant keyframe is dropped.
    """

    features: int = 1000
    corner_quality: float = 0.003
    corner_distance_px: float = 6.0
    border_px: float = 2.0
    max_depth_step: float = 0.05
    min_depth_m: float = 0.2
    max_depth_m: float = 8.0
    search_radius_px: float = 20.0
    wide_search_radius_px: float = 80.0
    max_hamming: int = 70
    ratio: float = 0.8
    ransac_px: float = 3.75
    inlier_px: float = 2.5
    inlier_sigmas: float = 8.0
    huber: float = 1.0
    depth_sigma_floor_m: float = 0.004
    depth_sigma_growth_per_m: float = 0.003
    min_inliers: int = 15
    relocalisation_inliers: int = 30
    relocalisation_sigma_m: float = 0.01
    insert_below: float = 0.7
    map_points: int = 5000
    fusion_depth: int = 20
    keyframe_distance_m: float = 0.15
    keyframe_angle_rad: float = 0.15
    max_keyframes: int = 1000

    def __post_init__(self) -> None:
        """Refuse values that cannot work."""
        for name in ("features", "search_radius_px", "map_points", "fusion_depth", "inlier_px", "max_depth_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"odometry settings: {name} must be positive")
        if self.min_inliers < 6:
            raise ValueError("odometry settings: min_inliers below 6 cannot confirm a pose")
        if self.max_keyframes < 3:
            raise ValueError("odometry settings: max_keyframes must be at least 3")
