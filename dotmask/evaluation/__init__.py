"""Metrics on plain arrays and small records: trajectory, matching, identities, filter, classification, masks."""
