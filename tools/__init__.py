"""Scripts that made the assets and the tables of the documents. Not installed, and not run by the tests."""
