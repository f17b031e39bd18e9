"""Sequences as folders: the formats of `dotmask render`, each written frame by frame."""
