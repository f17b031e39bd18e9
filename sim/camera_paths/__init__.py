"""Where the camera is over time. Every path is a pure function of time."""
