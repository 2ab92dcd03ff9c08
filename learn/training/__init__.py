"""Training of the keypoint model."""
