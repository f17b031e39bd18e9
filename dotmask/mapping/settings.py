"""Parameters of the map."""

from dataclasses import dataclass

REFERENCE_WIDTH_PX = 640
"""Image width that the settings in pixels are meant for; they scale with the width of the image, down to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingSettings:
    """What the map is built from, and how finely. Lengths in pixels hold at a width of 640.

    Attributes:
        step_m: a frame becomes a view when the camera has moved so far since the view before ...
        step_rad: ... or turned so far ...
        step_s: ... or when so much time has passed: what a person hid from a camera that stands still is seen later.
        most_views: bound on memory; beyond it the most redundant view is dropped.
        nearest_m, farthest_m: depth outside of this range is not used. Errors of depth grow with its square.
        edge_jump: two depths belong to one surface if they differ by no more than this share.
        edge_px: no depth as near as this to a jump of the depth: there the sensor mixes both sides (flying pixels).
        hole_px: no depth as near as this to a pixel without depth, hence to the borders of what was masked: the outline
            of a mask is of another moment than the depth.
        voxel_m: side of the voxels of the cloud and of the mesh.
        pixel_step: the cloud takes every so many-th pixel in u and v.
        least_views: a point of the cloud is kept if so many views measured something around it ...
        support_voxels: ... in the same cube of so many voxels along an axis. Far away the noise is wider than a voxel,
            so two views of one place rarely meet in the same voxel.
        truncation_m: signed distances beyond it are cut off; surfaces closer together than twice that disturb each
            other.
        least_part_faces: connected parts of the mesh with fewer faces are left out.
    """

    step_m: float = 0.1
    step_rad: float = 0.1
    step_s: float = 0.3
    most_views: int = 150
    nearest_m: float = 0.4
    farthest_m: float = 4.5
    edge_jump: float = 0.04
    edge_px: int = 1
    hole_px: int = 2
    voxel_m: float = 0.02
    pixel_step: int = 2
    least_views: int = 2
    support_voxels: int = 3
    truncation_m: float = 0.08
    least_part_faces: int = 200

    def __post_init__(self) -> None:
        """Refuse values that cannot work."""
        for name in ("step_m", "step_rad", "step_s", "nearest_m", "edge_jump", "voxel_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"mapping settings: {name} must be positive")
        for name, least in (
            ("most_views", 2),
            ("pixel_step", 1),
            ("least_views", 1),
            ("support_voxels", 1),
            ("edge_px", 0),
            ("hole_px", 0),
        ):
            if getattr(self, name) < least:
                raise ValueError(f"mapping settings: {name} must be at least {least}")
        if not self.nearest_m < self.farthest_m:
            raise ValueError(f"mapping settings: the range {self.nearest_m} to {self.farthest_m} m is empty")
        if self.truncation_m < 2 * self.voxel_m:
            raise ValueError("mapping settings: truncation_m must be at least two voxels")

    @staticmethod
    def at_width(length_px: int, width_px: int) -> int:
        """A length in pixels of these settings, in an image of another width."""
        return max(1, round(length_px * width_px / REFERENCE_WIDTH_PX)) if length_px else 0
