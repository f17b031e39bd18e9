import hashlib

import numpy as np
import pytest

from sim.assets import asset_path, load_npz, manifest
from sim.errors import AssetError
from sim.people.characters import CHARACTERS, Character, load_character, skin
from sim.scene import Surface

PARTS = ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
COCO_KEYPOINTS = ("nose", *(f"{side}_{part}" for part in PARTS for side in ("left", "right")))
EVERYONE = [(name, outfit) for name, outfits in CHARACTERS.items() for outfit in outfits]


@pytest.fixture(params=EVERYONE, ids="-".join)
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(*request.param)


def face_cross(surface: Surface) -> np.ndarray:
    """Twice the area of each triangle times its normal."""
    a, b, c = (surface.vertices[surface.faces[:, k]].astype(float) for k in range(3))
    return np.cross(b - a, c - a)


def pieces(surface: Surface) -> np.ndarray:
    """A number for each vertex: equal for vertices that faces connect."""
    label = np.arange(len(surface.vertices))
    while True:
        low = label[surface.faces].min(1)
        new = label.copy()
        for k in range(3):
            np.minimum.at(new, surface.faces[:, k], low)
        if np.array_equal(new, label):
            return label
        label = new


def test_a_person_has_plausible_height_and_size(character: Character) -> None:
    points = np.concatenate([s.vertices for s in character.surfaces])
    assert 1.55 < character.height_m < 1.91
    assert points[:, 2].min() == 0.0
    assert np.ptp(points[:, 0]) < 1.4
    assert np.abs(points[:, 0].max() + points[:, 0].min()) < 0.03
    assert sum(len(s.faces) for s in character.surfaces) <= 15_000


def test_the_heights_are_spread_from_short_to_tall() -> None:
    heights = {name: load_character(name).height_m for name in CHARACTERS}
    assert len(heights) >= 4
    assert min(heights.values()) < 1.60
    assert max(heights.values()) > 1.87
    assert np.diff(sorted(heights.values())).min() > 0.05


def test_everybody_has_at_least_two_outfits() -> None:
    assert all(len(outfits) >= 2 for outfits in CHARACTERS.values())
    assert "plaid" in CHARACTERS["man"]


def test_the_files_are_those_of_the_manifest_and_small() -> None:
    names = [name for name in manifest() if name.startswith("humans/")]
    assert names == sorted(f"humans/{name}.npz" for name in CHARACTERS)
    contents = {name: asset_path(name).read_bytes() for name in names}
    assert sum(len(content) for content in contents.values()) < 8_000_000
    for name, content in contents.items():
        assert hashlib.sha256(content).hexdigest() == manifest()[name].sha256
        assert manifest()[name].licence == "CC0-1.0"


def test_the_keypoints_are_where_a_body_has_them(character: Character) -> None:
    points = dict(zip(COCO_KEYPOINTS, character.keypoints.points, strict=True))
    order = ("eye", "ear", "shoulder", "elbow", "wrist", "knee", "ankle")
    heights = [points[f"left_{name}"][2] for name in order]
    assert character.height_m - 0.25 < heights[0] < character.height_m - 0.08
    assert heights == sorted(heights, reverse=True)
    assert points["left_shoulder"][2] < points["nose"][2] < points["left_eye"][2]
    assert points["left_knee"][2] < points["left_hip"][2] < points["left_elbow"][2]
    for name in (*order, "hip"):
        left, right = points[f"left_{name}"], points[f"right_{name}"]
        assert left[0] > 0.02
        np.testing.assert_allclose(left * [-1, 1, 1], right, atol=1e-3)
    assert abs(points["nose"][0]) < 1e-6
    assert points["nose"][1] < points["left_eye"][1] < points["left_ear"][1]


def test_face_keypoints_lie_on_the_surface_and_joints_inside(character: Character) -> None:
    points = character.keypoints.points
    face = np.concatenate([character.surface(name).vertices for name in ("skin", "eyes")])
    nearest = np.linalg.norm(points[:5, None] - face[None], axis=2).min(1)
    assert nearest.max() < 0.006
    everything = np.concatenate([s.vertices for s in character.surfaces])
    nearest = np.linalg.norm(points[5:, None] - everything[None], axis=2).min(1)
    assert nearest.min() > 0.008
    assert nearest.max() < 0.15


def test_keypoints_move_with_the_bone_that_begins_there(character: Character) -> None:
    rig, skeleton = character.keypoints, character.skeleton
    assert rig.bones.shape == rig.weights.shape == (17, 4)
    np.testing.assert_array_equal(rig.weights.sum(1), 1.0)
    joints = ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")
    bones = ["Head"] * 5 + [side + joint for joint in joints for side in ("Left", "Right")]
    assert [skeleton.names[b] for b in rig.bones[:, 0]] == bones
    for point, bone in zip(rig.points[5:], bones[5:], strict=True):
        np.testing.assert_allclose(point, skeleton.heads[skeleton.index(bone)], atol=1e-6)


def test_the_person_faces_minus_y_with_its_left_at_plus_x(character: Character) -> None:
    skeleton = character.skeleton
    eyes = character.surface("eyes").vertices.mean(0)
    heads = dict(zip(skeleton.names, skeleton.heads, strict=True))
    assert eyes[1] < heads["Head"][1] - 0.05
    assert heads["LeftToeBase"][1] < heads["LeftFoot"][1]
    assert all(heads["Left" + b][0] > 0 > heads["Right" + b][0] for b in ("UpLeg", "Foot", "Arm", "Hand"))


def test_skeleton_is_a_tree_in_order_inside_the_body(character: Character) -> None:
    skeleton = character.skeleton
    assert len(skeleton.names) == len(skeleton.parents) == len(skeleton.heads) == 31
    assert skeleton.parents[0] == -1
    assert all(0 <= parent < bone for bone, parent in enumerate(skeleton.parents) if bone)
    assert skeleton.heads[:, 2].min() > 0.02
    assert skeleton.heads[:, 2].max() < character.height_m - 0.1


def test_weights_sum_to_one_exactly(character: Character) -> None:
    for surface in character.surfaces:
        assert surface.weights is not None
        assert surface.bones is not None
        assert (surface.weights.sum(1) == 1.0).all()
        assert (surface.weights >= 0).all()
        assert surface.bones.min() >= 0
        assert surface.bones.max() < len(character.skeleton.names)


def test_normals_are_unit_and_agree_with_the_faces(character: Character) -> None:
    for name, surface in zip(character.surface_names, character.surfaces, strict=True):
        np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-5)
        if name == "hair":  # its normals are the head's: a lock's underside disagrees on purpose
            continue
        cross = face_cross(surface)
        agree = (cross * surface.normals[surface.faces].mean(1)).sum(1) > 0
        area = np.linalg.norm(cross, axis=1)
        assert area[agree].sum() > 0.97 * area.sum(), name


@pytest.mark.parametrize("name", CHARACTERS)
def test_closed_pieces_are_oriented_outwards(name: str) -> None:
    hair = load_character(name).surface("hair")
    label = pieces(hair)[hair.faces[:, 0]]
    a, b, c = (hair.vertices[hair.faces[:, k]].astype(float) for k in range(3))
    locks = 0
    for piece in np.unique(label):
        own = label == piece
        faces = hair.faces[own]
        edges = {tuple(e) for e in np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()}
        if len(edges - {(j, i) for i, j in edges}) > 3:
            continue  # the cap on the scalp; a lock is open only at its root, a triangle inside the cap
        middle = a[own].mean(0)
        volume = ((a[own] - middle) * np.cross(b[own] - middle, c[own] - middle)).sum() / 6
        assert volume > 0
        locks += 1
    assert locks > 100


def test_parts_are_oriented_outwards(character: Character) -> None:
    for name in ("skin", "shirt", "trousers", "shoes", "eyes"):
        surface = character.surface(name)
        a, b, c = (surface.vertices[surface.faces[:, k]].astype(float) for k in range(3))
        middle = surface.vertices.mean(0)
        assert ((a - middle) * np.cross(b - middle, c - middle)).sum() > 0, name


def test_identity_palette_leaves_the_rest_pose(character: Character) -> None:
    palette = np.tile(np.eye(4), (len(character.skeleton.names), 1, 1))
    for surface in character.surfaces:
        assert surface.bones is not None
        assert surface.weights is not None
        posed = skin(surface.vertices, surface.bones, surface.weights, palette)
        np.testing.assert_allclose(posed, surface.vertices, rtol=0, atol=1e-12)


def test_skin_blends_the_matrices() -> None:
    palette = np.tile(np.eye(4), (2, 1, 1))
    palette[0, :3, 3] = (1.0, 0.0, 0.0)
    palette[1, :3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    bones = np.array([[0, 1, 0, 0]], np.int32)
    weights = np.array([[0.75, 0.25, 0.0, 0.0]], np.float32)
    moved, turned = np.array([3.0, 3.0, 4.0]), np.array([-3.0, 2.0, 4.0])
    posed = skin(np.array([[2.0, 3.0, 4.0]]), bones, weights, palette)
    np.testing.assert_allclose(posed, [0.75 * moved + 0.25 * turned])


def test_a_raised_forearm_moves_the_hand_and_nothing_far_from_it(character: Character) -> None:
    skeleton = character.skeleton
    elbow = skeleton.names.index("LeftForeArm")
    moving = {elbow}
    for bone, parent in enumerate(skeleton.parents):
        if parent in moving:
            moving.add(bone)
    palette = np.tile(np.eye(4), (len(skeleton.names), 1, 1))
    palette[sorted(moving), 2, 3] = 0.3
    surface = character.surface("skin")
    assert surface.bones is not None
    assert surface.weights is not None
    rise = skin(surface.vertices, surface.bones, surface.weights, palette)[:, 2] - surface.vertices[:, 2]
    hand = np.linalg.norm(surface.vertices - skeleton.heads[skeleton.names.index("LeftHandFinger1")], axis=1) < 0.06
    assert hand.sum() > 50
    np.testing.assert_allclose(rise[hand], 0.3, atol=0.01)
    np.testing.assert_allclose(rise[surface.vertices[:, 0] < 0.2], 0.0, atol=0.01)


def test_only_shoes_have_soles_and_they_lie_on_the_floor(character: Character) -> None:
    for name, surface, soles in zip(character.surface_names, character.surfaces, character.soles, strict=True):
        assert (len(soles) > 0) == (name == "shoes")
        if name == "shoes":
            assert surface.vertices[soles, 2].max() < 0.02
            assert (surface.vertices[soles, 0] > 0).any()
            assert (surface.vertices[soles, 0] < 0).any()
            assert 0.2 < np.ptp(surface.vertices[soles, 1]) < 0.4


def test_textures_show_something(character: Character) -> None:
    for surface in character.surfaces:
        size = surface.texture.shape[0]
        assert size & (size - 1) == 0
        assert surface.texture.std() > 3
        assert np.isfinite(surface.uv).all()


@pytest.mark.parametrize("name", CHARACTERS)
def test_outfits_share_the_body_and_differ_in_the_clothes(name: str) -> None:
    first, second = (load_character(name, outfit) for outfit in CHARACTERS[name])
    np.testing.assert_array_equal(first.surface("skin").texture, second.surface("skin").texture)
    for part in ("shirt", "trousers", "shoes"):
        a, b = first.surface(part), second.surface(part)
        np.testing.assert_array_equal(a.vertices, b.vertices)
        assert np.abs(a.texture.astype(int) - b.texture).mean() > 8
    assert ("collar" in first.surface_names) != ("collar" in second.surface_names)


def test_the_table_of_characters_is_what_the_files_hold() -> None:
    for name, outfits in CHARACTERS.items():
        assert tuple(str(o) for o in load_npz(f"humans/{name}.npz")["outfits"]) == outfits


def test_a_character_is_loaded_once_and_cannot_be_changed() -> None:
    character = load_character("man")
    assert character is load_character("man", CHARACTERS["man"][0])
    with pytest.raises(ValueError, match="read-only"):
        character.surfaces[0].vertices[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        character.skeleton.heads[0] = 0


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AssetError, match="no character named 'child'; choose one of man, woman, tall_man, short_woman"):
        load_character("child")
    with pytest.raises(AssetError, match="man has no outfit 'toga'; choose one of plaid, green"):
        load_character("man", "toga")
    with pytest.raises(KeyError, match="no part 'hat'"):
        load_character("man").surface("hat")
