"""Shadow casters, boxes on the screen and mip levels, each alone."""

import numpy as np

from sim.renderers.shadows import screen_box, simplified
from sim.renderers.textures import TextureAtlas
from sim.renderers.visibility_buffer import NEAR_M


def test_shadow_casters_are_coarse_and_keep_their_winding() -> None:
    n = 60
    phi, theta = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1), indexing="ij")
    normals = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1).reshape(-1, 3)
    normals = normals.astype(np.float32)
    number = np.arange(len(normals), dtype=np.uint32).reshape(phi.shape)
    a, b, c, d = (x.ravel() for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    kept, coarse = simplified(
        np.float32(0.15) * normals, faces, np.zeros(len(normals), np.int32), np.full(len(normals), 0.03, np.float32)
    )
    assert len(coarse) < len(faces) / 2
    points = normals[kept].astype(float)
    p, q, r = (points[coarse[:, k]] for k in range(3))
    outward = (np.cross(q - p, r - p) * (p + q + r)).sum(1)
    assert (outward > -1e-6).mean() > 0.95
    volume = (np.cross(p, q) * r).sum() / 6
    assert 0.9 < volume / (4 / 3 * np.pi) < 1.01  # still closed


def test_the_box_of_a_mesh_holds_its_pixels() -> None:
    inside = np.array([[0, 0, 2.0, 20.4, 30.6, 0.5], [0, 0, 3.0, 40.2, 35.0, 0.33]], np.float32)
    assert screen_box(inside, NEAR_M, 160, 120) == (29, 37, 19, 43)
    assert screen_box(inside + np.array([0, 0, 0, 500, 0, 0], np.float32), NEAR_M, 160, 120) == (
        0,
        0,
        0,
        0,
    )  # beside the image
    assert screen_box(inside * np.array([1, 1, -1, 1, 1, 1], np.float32), NEAR_M, 160, 120) == (0, 0, 0, 0)  # behind
    reaching_through = inside * np.array([[1, 1, -1, 1, 1, 1], [1, 1, 1, 1, 1, 1]], np.float32)
    assert screen_box(reaching_through, NEAR_M, 160, 120) == (0, 120, 0, 160)
    assert screen_box(inside[:0], NEAR_M, 160, 120) == (0, 0, 0, 0)


def test_mip_levels_are_means() -> None:
    image = np.arange(4 * 4 * 3, dtype=np.uint8).reshape(4, 4, 3) * 5
    atlas = TextureAtlas.of([image, image[:2, :2]])
    np.testing.assert_array_equal(atlas.offsets, [0, 21])
    np.testing.assert_array_equal(atlas.sizes, [4, 2])
    assert len(atlas.texels) == 21 + 5
    last = atlas.texels[20]
    mean = image.reshape(-1, 3).mean(0)
    np.testing.assert_allclose([last & 255, last >> 8 & 255, last >> 16], mean, atol=1)


def test_texels_lie_in_tiles_of_one_cache_line() -> None:
    image = np.zeros((8, 8, 3), np.uint8)
    image[..., 0] = np.arange(64).reshape(8, 8)  # 8 v + u
    tiles = TextureAtlas.of([image]).texels[:64].reshape(4, 16)
    for tile, (v, u) in zip(tiles, [(0, 0), (0, 4), (4, 0), (4, 4)], strict=True):
        np.testing.assert_array_equal(np.sort(tile), np.sort(image[v : v + 4, u : u + 4, 0].ravel()))
    np.testing.assert_array_equal(tiles[0], [0, 1, 8, 9, 2, 3, 10, 11, 16, 17, 24, 25, 18, 19, 26, 27])
