"""Odometry over folders of scans, and its metrics."""
