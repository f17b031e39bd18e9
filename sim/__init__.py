"""The world: geometry, light, motion and the camera's sensor. It never knows the method.

PYTEST_DONT_REWRITE: pytest would warn of every program that imports this before it starts pytest.
"""

DISTRIBUTION = "dotmask"
