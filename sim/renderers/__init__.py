"""Renderers: they turn a posed scene into colour, depth and instance ids."""
