"""Scripts that made the assets. Not installed, and not run by the tests."""
