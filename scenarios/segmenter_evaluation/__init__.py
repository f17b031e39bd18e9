"""How good a segmenter is on rendered frames: average precision, overlaps, what it misses and how long it takes."""
