"""The keypoint model: U-Net, keypoints, descriptors, matching."""
