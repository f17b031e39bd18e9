"""SLAM back ends behind the SlamBackend interface."""
