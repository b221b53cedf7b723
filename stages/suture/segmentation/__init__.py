"""Needle and thread in a picture: a small U-Net, its checkpoint, and masks out of what it says."""
