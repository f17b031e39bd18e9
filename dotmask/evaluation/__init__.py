"""Metrics on plain arrays: trajectory, tracking, classification, masks."""
