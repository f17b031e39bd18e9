"""A front end for RGB-D SLAM that hides people, as somebody might begin it."""
