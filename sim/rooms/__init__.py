"""Rooms: a shell, furniture, lights, and what blocks the way."""
