"""The step `disparity`: depth from the stereo pairs of a sequence."""
