"""Pictures of a run: what the camera saw, what the method decided, what SLAM was given, and where everybody went.

And of a rendered sequence: what the camera saw, and the truth about it.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Self

import cv2
import numpy as np
import numpy.typing as npt

from dotmask.pipeline import FrameResult
from dotmask.records import FloatArray
from scenarios.errors import ScenarioError
from sim.records import SimFrame

Picture = npt.NDArray[np.uint8]

MOVING, IDLE = (230, 60, 50), (70, 200, 90)
TRUTH = (245, 245, 245)
METHOD_COLOURS = ((240, 120, 60), (90, 170, 250), (110, 220, 120))
BACKGROUND = (24, 26, 32)
DEPTH_RANGE_M = (0.5, 5.0)


def colour_panel(result: FrameResult) -> Picture:
    """The colour image with the detections tinted: red = moving, green = idle, and each track's class, id and speed."""
    image = result.frame.rgb.copy()
    detections = result.front_end.detections
    if detections is None:
        return image
    tracks = {t.detection_index: t for t in result.front_end.tracks if t.detection_index is not None}
    for index in range(len(detections)):
        track = tracks.get(index)
        moving = track is None or track.verdict is None or track.verdict.is_moving
        colour = MOVING if moving else IDLE
        mask = detections.masks[index]
        image[mask] = (0.65 * image[mask] + 0.35 * np.array(colour)).astype(np.uint8)
        outline, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(image, outline, -1, colour, 2)
        if track is not None:
            u, v = detections.boxes_px[index][:2].astype(int)
            speed = float(np.linalg.norm(track.velocity_world))
            text = f"{track.class_name} {track.track_id}  {speed:.2f} m/s"
            _label(image, text, (max(u, 2), max(v - 6, 14)))
    return image


def depth_panel(depth_m: npt.NDArray[np.float32]) -> Picture:
    """Depth in colour, near = warm; black = no return or masked."""
    near, far = DEPTH_RANGE_M
    scaled = np.clip((far - depth_m) / (far - near), 0, 1) * 255
    picture = cv2.cvtColor(cv2.applyColorMap(scaled.astype(np.uint8), cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB)
    picture[depth_m == 0] = 0
    return np.asarray(picture, np.uint8)


def _label(image: Picture, text: str, corner: tuple[int, int]) -> None:
    for colour, width in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, width, cv2.LINE_AA)


class PathsPanel:
    """The camera's true path and each method's estimate, seen from above, drawn further with every frame."""

    def __init__(self, width: int, height: int, methods: tuple[str, ...]) -> None:
        self._size, self._methods = (width, height), methods
        self._paths: dict[str, list[npt.NDArray[np.float64] | None]] = {name: [] for name in ("truth", *methods)}

    def add(self, T_world_camera: FloatArray | None, results: Mapping[str, FrameResult]) -> None:
        """Append this frame's positions: the true one (4, 4) where it is known, and those of the methods."""
        self._paths["truth"].append(None if T_world_camera is None else T_world_camera[:2, 3])
        for name in self._methods:
            pose = results[name].pose.T_world_camera
            self._paths[name].append(None if pose is None else pose[:2, 3])

    def draw(self) -> Picture:
        """The panel; the scale fits all paths."""
        width, height = self._size
        image = np.full((height, width, 3), BACKGROUND, np.uint8)
        # The panel shows the origin where there is no position at all.
        points = np.array([p for path in self._paths.values() for p in path if p is not None] or [np.zeros(2)])
        low, high = points.min(axis=0), points.max(axis=0)
        span = max(float((high - low).max()), 0.2)
        middle = (low + high) / 2
        scale = 0.8 * min(width, height) / span
        colours = (TRUTH, *METHOD_COLOURS)
        for row, ((name, path), colour) in enumerate(zip(self._paths.items(), colours, strict=False)):
            previous = None
            for point in path:
                pixel = None
                if point is not None:
                    u, v = width / 2 + (point[0] - middle[0]) * scale, height / 2 - (point[1] - middle[1]) * scale
                    pixel = (round(u), round(v))
                    if previous is not None:
                        cv2.line(image, previous, pixel, colour, 2 if name == "truth" else 1, cv2.LINE_AA)
                previous = pixel
            cv2.putText(image, name, (12, 22 + 20 * row), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
        _label(image, f"camera from above, {span:.2f} m across", (12, height - 12))
        return image


def write_picture(path: Path, picture: Picture) -> None:
    """Write `picture` as a PNG file."""
    done, encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    assert done
    path.write_bytes(encoded.tobytes())


def mosaic(panels: list[tuple[str, Picture]]) -> Picture:
    """Four titled panels of one size, two by two."""
    for title, panel in panels:
        _label(panel, title, (12, panel.shape[0] - 12))
    pictures = [panel for _, panel in panels]
    return np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])])


class VideoFile:
    """An mp4 file in the making.

    Args:
        path: of the file.
        rate_hz: pictures a second.
        size: width and height.

    Raises:
        ScenarioError: OpenCV has no encoder for it here.
    """

    def __init__(self, path: Path, rate_hz: float, size: tuple[int, int]) -> None:
        self._size = size
        self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate_hz, size)
        if not self._writer.isOpened():
            raise ScenarioError("--video: this build of OpenCV cannot write mp4 files; run without --video")

    def add(self, picture: Picture) -> None:
        """Append a picture, reduced to the size of the video."""
        if picture.shape[1::-1] != self._size:
            picture = np.asarray(cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        self._writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))

    def close(self) -> None:
        """Finish the file."""
        self._writer.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Video:
    """Writes the mosaic of every frame of a run to an mp4 file.

    Args:
        path: of the file.
        rate_hz: pictures a second.
        size: width and height of the frames.
        methods: that are run; `dotmask` is shown, without it the last one.

    Raises:
        ScenarioError: OpenCV has no encoder for it here.
    """

    def __init__(self, path: Path, rate_hz: float, size: tuple[int, int], methods: tuple[str, ...]) -> None:
        self._shown = "dotmask" if "dotmask" in methods else methods[-1]
        self._file = VideoFile(path, rate_hz, (3 * size[0] // 2, 3 * size[1] // 2))

    def add(self, results: Mapping[str, FrameResult], paths: PathsPanel) -> None:
        """Append one frame; `paths` holds the positions up to it."""
        self._file.add(frame_picture(results[self._shown], paths))

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


def frame_picture(result: FrameResult, paths: PathsPanel) -> Picture:
    """The mosaic of one frame."""
    masked, (height, width) = result.front_end.masked, result.frame.depth_m.shape
    return mosaic(
        [
            ("red: moving, green: idle", colour_panel(result)),
            ("MO-MDI, to odometry", depth_panel(masked.mo_mdi_m)),
            ("MDI, to the map", depth_panel(masked.mdi_m)),
            ("", np.asarray(cv2.resize(paths.draw(), (width, height), interpolation=cv2.INTER_AREA), np.uint8)),
        ]
    )


def hidden_panel(result: FrameResult) -> Picture:
    """The colour image in grey; red: hidden from odometry, green: hidden from the map alone."""
    masked, depth_m = result.front_end.masked, result.frame.depth_m
    image = cv2.cvtColor(cv2.cvtColor(result.frame.rgb, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    from_odometry = (depth_m > 0) & (masked.mo_mdi_m == 0)
    from_map = (depth_m > 0) & (masked.mdi_m == 0) & ~from_odometry
    for hidden, colour in ((from_map, IDLE), (from_odometry, MOVING)):
        image[hidden] = (0.4 * image[hidden] + 0.6 * np.array(colour)).astype(np.uint8)
    return np.asarray(image, np.uint8)


def side_by_side(panels: list[tuple[str, Picture]]) -> Picture:
    """Titled panels of one height in a row."""
    for title, panel in panels:
        _label(panel, title, (12, panel.shape[0] - 12))
    return np.hstack([panel for _, panel in panels])


def truth_picture(frame: SimFrame, actors: Collection[int]) -> Picture:
    """Colour, measured depth and true masks of one frame side by side; whoever moves has a red outline.

    Args:
        frame: to show.
        actors: instance ids of what can move: shown in bright colours, the rest in dull ones.
    """
    return side_by_side(
        [
            ("colour", frame.rgb.copy()),
            ("depth", depth_panel(frame.depth_m)),
            ("masks", _masks_panel(frame, actors)),
        ]
    )


def _masks_panel(frame: SimFrame, actors: Collection[int]) -> Picture:
    ids = frame.truth.instance_ids
    # Hues by the golden ratio: neighbouring ids differ most. OpenCV's hue runs to 180.
    numbers = np.arange(int(ids.max()) + 1)
    hsv = np.zeros((len(numbers), 1, 3), np.uint8)
    hsv[:, 0, 0] = (numbers * 0.61803398875 % 1.0 * 180).astype(np.uint8)
    bright = np.isin(numbers, list(actors))
    hsv[:, 0, 1], hsv[:, 0, 2] = np.where(bright, 190, 70), np.where(bright, 240, 95)
    colours = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[:, 0]
    colours[0] = BACKGROUND
    picture = np.asarray(colours[ids], np.uint8)
    for actor in frame.truth.objects:
        if actor.visible_pixels and actor.is_moving:
            outline, _ = cv2.findContours(
                (ids == actor.instance_id).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
            )
            cv2.drawContours(picture, outline, -1, MOVING, 2)
    return picture
