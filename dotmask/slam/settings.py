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


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSettings:
    """Parameters of loop closure and the pose graph, calibrated on synthetic sequences of 640 x 480 pixels.

    Lengths in pixels hold at a width of 640 and scale with the image width.

    Attributes:
        recent_keyframes: the last so many keyframes close no loop: odometry sees the same points itself.
        candidates: at most this many similar places are verified per keyframe.
        relocalisation_candidates: earlier keyframes that are tried for a frame that odometry has lost.
        relative_similarity: a place must be this similar to a keyframe, in terms of the keyframe before it.
        proximity_distance_m: without a loop by looks, keyframes are tried whose odometry poses are this near ...
        proximity_angle_rad: ... and look in directions that differ by less than this.
        max_hamming: most differing bits (of 256) of two descriptors that match.
        ratio: a match must be this much nearer than the second best (Lowe 2004).
        min_match_share: least share of the matches that must agree with one relative pose; when somebody in view has
            moved in between, either those on the person or all others do not.
        guided_radius_px: search window of the second matching, around where the first pose expects each corner.
        min_inliers: least matches that must agree with the relative pose in each direction.
        min_cells: least number of the image's `CELLS` that hold inliers, in each image.
        max_translation_sigma_m: largest standard deviation of the translation along any axis.
        max_disagreement_m: most by which the poses solved in the two directions may differ ...
        max_disagreement_rad: ... and in rotation.
        depth_tolerance: share of the depth by which a surface may be off.
        min_overlap: least share of one image's surfaces that must be in view of the other.
        min_agreeing: least share of the surfaces in view that must lie on each other.
        max_violating: most of them that may lie where the other image has looked through.
        pixel_sigma_px: standard deviation of a corner, for the covariance of a loop; wide enough for what the errors of
            many corners have in common.
        odometry_covariance_scale: factor on the covariance that the poses of odometry state, for what the errors of
            consecutive poses have in common; measured 1.2 to 1.5 on walking and sitting sequences.
        rejection_probability: a loop is rejected when a right one would be as far from the optimised poses with less
            than this probability.
    """

    recent_keyframes: int = 10
    candidates: int = 1
    relocalisation_candidates: int = 3
    relative_similarity: float = 0.75
    proximity_distance_m: float = 0.5
    proximity_angle_rad: float = 0.5
    max_hamming: int = 64
    ratio: float = 0.85
    min_match_share: float = 0.7
    guided_radius_px: float = 8.0
    min_inliers: int = 40
    min_cells: int = 8
    max_translation_sigma_m: float = 0.005
    max_disagreement_m: float = 0.02
    max_disagreement_rad: float = 0.01
    depth_tolerance: float = 0.02
    min_overlap: float = 0.3
    min_agreeing: float = 0.85
    max_violating: float = 0.01
    pixel_sigma_px: float = 1.0
    odometry_covariance_scale: float = 1.5
    rejection_probability: float = 1e-4

    def __post_init__(self) -> None:
        """Refuse values that cannot work."""
        if self.recent_keyframes < 1:
            raise ValueError("loop settings: recent_keyframes must be at least 1")
        if self.min_inliers < 6:
            raise ValueError("loop settings: min_inliers below 6 cannot confirm a loop")
        for name in ("odometry_covariance_scale", "pixel_sigma_px"):
            if not getattr(self, name) > 0:
                raise ValueError(f"loop settings: {name} must be positive")
        if not 0 < self.rejection_probability < 1:
            raise ValueError("loop settings: rejection_probability must be between 0 and 1")
