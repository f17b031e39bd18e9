"""Which places look alike, on made-up words."""

import numpy as np
import pytest

from dotmask.slam.place_recognition import PlaceRecognition
from dotmask.slam.vocabulary import BagOfWords

WORDS = 64


def bags(count: int, seed: int) -> list[BagOfWords]:
    """Images of random words."""
    rng, made = np.random.default_rng(seed), []
    for _ in range(count):
        words = np.sort(rng.choice(WORDS, 12, replace=False))
        weights = rng.uniform(0.1, 1, 12)
        made.append(BagOfWords(words=words, weights=(weights / weights.sum()).astype(np.float32)))
    return made


def known(images: list[BagOfWords]) -> PlaceRecognition:
    places = PlaceRecognition(WORDS)
    for number, bag in enumerate(images):
        places.add(number, bag)
    return places


def test_similarities_equal_those_of_pairs_of_bags():
    images = bags(40, 1)  # more than the first capacity
    found = known(images).similarities(images[3])
    np.testing.assert_allclose(found, [images[3].similarity(other) for other in images], atol=1e-6)
    assert found[3] == pytest.approx(1.0)


def test_the_same_place_comes_first():
    images = bags(30, 2)
    places = known(images)
    for number in (0, 13, 29):
        best, *_ = places.similar(images[number], count=3)
        assert best.place == number
        assert best.similarity == pytest.approx(1.0)


def test_recent_places_and_weak_ones_are_left_out():
    images = bags(20, 3)
    places = known([*images, images[4]])
    assert [found.place for found in places.similar(images[4], count=5, least=0.9)] == [4, 20]
    assert [found.place for found in places.similar(images[4], count=5, least=0.9, before=20)] == [4]
    assert places.similar(images[4], count=5, least=0.9, before=4) == ()
    assert len(places.similar(images[4], count=2)) == 2


def test_neighbours_that_saw_the_same_are_one_answer():
    (place, *others) = bags(8, 4)
    mixed = [BagOfWords(words=place.words, weights=place.weights * share) for share in (0.8, 0.9, 1.0, 0.7)]
    places = known([*others[:3], *mixed, *others[3:]])
    assert [found.place for found in places.similar(place, count=4, least=0.6)] == [5]


def test_a_forgotten_place_is_not_found_and_the_others_stay():
    images = bags(20, 5)
    places = known(images)
    places.forget(7)
    assert len(places) == 19
    assert places.similar(images[7], count=1, least=0.9) == ()
    for number in (6, 8, 19):
        assert places.similar(images[number], count=1)[0].place == number
    places.add(20, images[7])
    assert places.similar(images[7], count=1)[0].place == 20


def test_numbers_must_rise():
    (bag,) = bags(1, 6)
    places = known([bag, bag])
    with pytest.raises(ValueError, match="place 1 does not come after 1"):
        places.add(1, bag)


def test_nothing_is_similar_to_nothing():
    (bag,) = bags(1, 7)
    empty = BagOfWords(words=np.zeros(0, np.intp), weights=np.zeros(0, np.float32))
    assert PlaceRecognition(WORDS).similar(bag, count=3) == ()
    assert known([bag, empty]).similar(empty, count=3) == ()
