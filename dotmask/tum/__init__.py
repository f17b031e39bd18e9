"""The formats of the TUM RGB-D benchmark, both ways: trajectory files and sequence folders.

A trajectory is a text file of lines `timestamp tx ty tz qx qy qz qw` (`T_world_camera`, seconds and metres). A sequence
folder holds `rgb/*.png`, `depth/*.png` (16 bit, 5000 per metre, 0 = no return), the lists `rgb.txt` and `depth.txt`,
and mostly `groundtruth.txt`. The format has no place for the camera: it is recognised from the folder's name, given
by the caller, or read from `camera.json`, our addition.

Source: Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012, and its page
https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

from dotmask.tum.camera import (
    CAMERA_FILE,
    DEPTH_PER_METRE,
    MAX_DEPTH_M,
    PUBLISHED,
    RecordedCamera,
    camera_json,
    find_camera,
    read_camera,
)
from dotmask.tum.reader import TumSequence, read_sequence
from dotmask.tum.trajectory_file import format_trajectory, pose_columns, read_trajectory, write_trajectory
from dotmask.tum.writer import LIST_HEADER, TumSequenceWriter, colour_png, depth_png, ids_png, stamp_text

__all__ = [
    "CAMERA_FILE",
    "DEPTH_PER_METRE",
    "LIST_HEADER",
    "MAX_DEPTH_M",
    "PUBLISHED",
    "RecordedCamera",
    "TumSequence",
    "TumSequenceWriter",
    "camera_json",
    "colour_png",
    "depth_png",
    "find_camera",
    "format_trajectory",
    "ids_png",
    "pose_columns",
    "read_camera",
    "read_sequence",
    "read_trajectory",
    "stamp_text",
    "write_trajectory",
]
