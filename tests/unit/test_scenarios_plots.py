from pathlib import Path

import cv2
import matplotlib
import numpy as np

from scenarios.plots import Scatter, draw_scatters, figure_file


def scatters(path: Path) -> bytes:
    panels = [
        Scatter(title=title, note="note", x=np.array([0.0, 0, 30, 400]), y=np.array([1.0, 2, 3, 4]) * scale)
        for title, scale in (("left", 1.0), ("right", 0.5))
    ]
    draw_scatters(path, "title", "x", "y", panels)
    return path.read_bytes()


def test_the_bytes_are_the_same_every_time_and_whatever_style_the_user_has(tmp_path: Path) -> None:
    first = scatters(tmp_path / "a.png")
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 30.0}):
        assert scatters(tmp_path / "b.png") == first
    assert b"atplotlib" not in first


def test_both_panels_are_drawn_on_the_same_axes(tmp_path: Path) -> None:
    scatters(tmp_path / "a.png")
    picture = cv2.imread(str(tmp_path / "a.png")).astype(int)
    assert picture.shape[1] > 2 * picture.shape[0] > 800
    orange = (picture[..., 2] - picture[..., 0]) > 60
    left, right = (np.argwhere(half) for half in np.split(orange[:, : picture.shape[1] // 2 * 2], 2, axis=1))
    heights = [points[points[:, 1].argmax(), 0] for points in (left, right)]  # of the point with the largest x
    assert heights[1] - heights[0] > 100, "half as large, so half as high on the same axis"


def test_a_panel_without_points_is_drawn_too(tmp_path: Path) -> None:
    draw_scatters(tmp_path / "a.png", "t", "x", "y", [Scatter(title="", note="", x=np.zeros(0), y=np.zeros(0))])
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_a_figure_is_written_at_the_end_of_its_block(tmp_path: Path) -> None:
    with figure_file(tmp_path / "a.png", 2, 1) as figure:
        figure.subplots()
        assert not (tmp_path / "a.png").exists()
    assert cv2.imread(str(tmp_path / "a.png")).shape == (130, 260, 3)
