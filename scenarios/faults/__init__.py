"""What a segmenter gets wrong: small pure functions on its detections, and the chain of them.

Every decision is drawn by a generator that is named after the fault, the frame and the instance: it depends neither on
the order of calls nor on which other faults are on.
"""
