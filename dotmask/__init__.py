"""DOTMask: dynamic object tracking and masking for visual SLAM (Vincent et al. 2020).

The method. It knows images, poses and time; it never sees the simulator or the truth.

PYTEST_DONT_REWRITE: pytest would warn of every program that imports this before it starts pytest.
"""
