"""Trains the network `compact` on rendered frames: what it may see, scenes, frames, the loop, the test, the card."""
