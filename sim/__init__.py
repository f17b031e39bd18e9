"""The world: geometry, light, motion and the camera's sensor. It never knows the method."""

DISTRIBUTION = "dotmask"
