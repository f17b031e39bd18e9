"""Networks behind the Segmenter interface, and which of their detections go on into the method."""
