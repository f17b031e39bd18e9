"""DOTMask: dynamic object tracking and masking for visual SLAM (Vincent et al. 2020).

The method. It knows images, poses and time; it never sees the simulator or the truth.
"""
