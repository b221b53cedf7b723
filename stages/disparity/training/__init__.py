"""What `disparity` is trained by."""
