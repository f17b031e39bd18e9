"""People: baked characters, their skeletons, and how they move."""
