"""Trains the visual vocabulary of place recognition on rooms that no scenario shows."""
