"""One scenario seed, named child generators: a new consumer never shifts the numbers of another."""

import hashlib

import numpy as np


def child(seed: int, *names: str | int) -> np.random.Generator:
    """The generator of the consumer `names` under the scenario's `seed`.

    The names are hashed into the key of a counter-based generator (Philox), so the streams of two names are
    independent, in any order of use and in any process. Seed 0 is a seed like any other.
    """
    text = "/".join([str(seed), *(str(n) for n in names)])
    key = np.frombuffer(hashlib.sha256(text.encode()).digest()[:16], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key))
