"""Hand-made odometry of the field, one file a method: keypoints of a scan, and the motion between two."""
