"""Section `stereo`: depth from two eyes."""
