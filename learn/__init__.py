"""Scans become keypoints, motion and places."""
