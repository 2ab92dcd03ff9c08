"""Scans as training data: images, pairs, augmentation, true motions."""
