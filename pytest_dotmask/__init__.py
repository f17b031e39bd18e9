"""The pytest plugin: a user's own segmenter, masking function or SLAM in the standard loop, compared with a baseline.

It is no part of `scenarios`, whose name is a common word: pytest imports a plugin wherever it is installed, also for a
project that has a package `scenarios` of its own. `pytest_dotmask.plugin` loads the rest where it is used.

PYTEST_DONT_REWRITE: pytest would warn of every program that imports this before it starts pytest.
"""
