"""Object tracking: motion model, measurement, extended Kalman filter, association, track life."""
