"""The visual vocabulary: its tree, its bags, its file, and how it is trained."""

from pathlib import Path

import numpy as np
import pytest

from dotmask import assets
from dotmask.errors import VocabularyError
from dotmask.slam.vocabulary import Vocabulary, load_vocabulary, read_vocabulary
from tools.asset_files import write_npz
from tools.train_vocabulary.clusters import k_majority, tree


def flipped(rng: np.random.Generator, descriptors: np.ndarray, share: float) -> np.ndarray:
    """Descriptors with `share` of their bits wrong."""
    return descriptors ^ np.packbits(rng.random((len(descriptors), 256)) < share, axis=1)


def small_vocabulary(rng: np.random.Generator, branches: int = 3) -> Vocabulary:
    levels = tuple(rng.integers(0, 256, (branches ** (k + 1), 32), dtype=np.uint8) for k in range(2))
    return Vocabulary(levels=levels, idf=rng.uniform(0, 3, branches**2).astype(np.float32))


def plain_word(vocabulary: Vocabulary, descriptor: np.ndarray) -> int:
    """The word by loops over the children of each node."""
    node, branches = 0, len(vocabulary.levels[0])
    for centres in vocabulary.levels:
        children = range(node * branches, (node + 1) * branches)
        node = min(children, key=lambda child: int(np.unpackbits(centres[child] ^ descriptor).sum()))
    return node


def test_words_equal_a_walk_down_the_tree():
    rng = np.random.default_rng(0)
    vocabulary = small_vocabulary(rng)
    descriptors = rng.integers(0, 256, (50, 32), dtype=np.uint8)
    wanted = [plain_word(vocabulary, descriptor) for descriptor in descriptors]
    assert len(set(wanted)) > 5
    assert vocabulary.words_of(descriptors).tolist() == wanted
    top = Vocabulary(levels=vocabulary.levels[:1], idf=np.ones(3, np.float32))
    assert vocabulary.parents_of(np.array(wanted)).tolist() == top.words_of(descriptors).tolist()


def test_bag_weighs_by_frequency_and_rarity():
    centres = np.zeros((3, 32), np.uint8)
    centres[1], centres[2] = 0x0F, 0xFF
    vocabulary = Vocabulary(levels=(centres,), idf=np.array([1.0, 3.0, 0.0], np.float32))
    bag = vocabulary.bag_of(vocabulary.words_of(centres[[0, 0, 0, 1, 2, 2]]))
    # 3 x 1 against 1 x 3; the word that every image shows tells nothing and is left out.
    assert bag.words.tolist() == [0, 1]
    np.testing.assert_allclose(bag.weights, [0.5, 0.5])


def test_similarity_is_the_weight_in_common():
    vocabulary = Vocabulary(levels=(np.zeros((4, 32), np.uint8),), idf=np.ones(4, np.float32))
    a, b = (vocabulary.bag_of(np.array(words)) for words in ([0, 0, 1, 2], [0, 2, 3, 3]))
    # Words 0 and 2 of both: min(1/2, 1/4) + min(1/4, 1/4).
    assert a.similarity(b) == pytest.approx(0.5)
    assert a.similarity(a) == pytest.approx(1.0)
    assert vocabulary.bag_of(np.zeros(0, np.intp)).similarity(a) == 0


def test_the_shipped_words_tell_noise_from_another_corner():
    vocabulary = load_vocabulary()
    assert 1000 <= len(vocabulary) <= 4000
    rng = np.random.default_rng(1)
    words = vocabulary.levels[-1][rng.integers(0, len(vocabulary), 400)]
    same = vocabulary.words_of(words) == vocabulary.words_of(flipped(rng, words, 0.05))
    other = vocabulary.words_of(words) == vocabulary.words_of(rng.permutation(words))
    assert same.mean() > 0.5
    assert other.mean() < 0.02


def test_k_majority_finds_the_kinds_and_their_bits():
    rng = np.random.default_rng(2)
    kinds = rng.integers(0, 256, (4, 32), dtype=np.uint8)
    truth = np.repeat(np.arange(4), 50)
    labels, centres = k_majority(flipped(rng, kinds[truth], 0.1), 4, rng)
    assert sorted(map(bytes, centres)) == sorted(map(bytes, kinds))
    assert [bytes(centres[label]) for label in labels] == [bytes(kinds[kind]) for kind in truth]


def test_training_is_a_function_of_its_seed_and_fills_the_tree():
    rng = np.random.default_rng(3)
    descriptors = flipped(rng, np.repeat(rng.integers(0, 256, (5, 32), dtype=np.uint8), 6, axis=0), 0.1)
    first, again = (tree(descriptors, 3, 3, np.random.default_rng(7)) for _ in range(2))
    # Most of the 27 leaves have too few descriptors to be divided; they must still be there.
    assert [len(level) for level in first] == [3, 9, 27]
    assert [level.tobytes() for level in first] == [level.tobytes() for level in again]
    assert Vocabulary(levels=tuple(first), idf=np.ones(27, np.float32)).words_of(descriptors).max() < 27


def test_file_reads_back_equal_and_has_the_same_bytes(tmp_path: Path):
    vocabulary = small_vocabulary(np.random.default_rng(4))
    arrays = {"level_0": vocabulary.levels[0], "level_1": vocabulary.levels[1], "idf": vocabulary.idf}
    for name in ("a.npz", "b.npz"):
        write_npz(tmp_path / name, arrays)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    read = read_vocabulary(tmp_path / "a.npz")
    np.testing.assert_array_equal(read.levels[1], vocabulary.levels[1])
    np.testing.assert_array_equal(read.idf, vocabulary.idf)


@pytest.mark.parametrize(
    "arrays",
    [
        {"idf": np.ones(3, np.float32)},
        {"level_0": np.zeros((3, 32), np.uint8)},
        {"level_0": np.zeros((3, 32), np.uint8), "idf": np.ones(4, np.float32)},
        {"level_0": np.zeros((3, 31), np.uint8), "idf": np.ones(3, np.float32)},
        {"level_0": np.array([{}], object), "idf": np.ones(3, np.float32)},
    ],
)
def test_a_damaged_file_says_what_to_do(tmp_path: Path, arrays: dict[str, np.ndarray]):
    np.savez(tmp_path / "words.npz", **arrays)
    with pytest.raises(VocabularyError, match=r"words\.npz cannot be read .* reinstall"):
        read_vocabulary(tmp_path / "words.npz")


def test_a_wheel_has_the_file_beside_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(assets, "__file__", str(tmp_path / "dotmask" / "assets.py"))
    load_vocabulary.cache_clear()
    try:
        with pytest.raises(VocabularyError, match="reinstall"):
            load_vocabulary()
        vocabulary = small_vocabulary(np.random.default_rng(5))
        arrays = {"level_0": vocabulary.levels[0], "level_1": vocabulary.levels[1], "idf": vocabulary.idf}
        write_npz(tmp_path / "dotmask_assets" / "slam" / "vocabulary.npz", arrays)
        assert len(load_vocabulary()) == 9
    finally:
        load_vocabulary.cache_clear()
