"""Networks behind the Segmenter interface."""
