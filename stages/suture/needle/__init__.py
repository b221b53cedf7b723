"""The needle's pose from masks, disparity and images of a stereo pair, and how sure it is."""
