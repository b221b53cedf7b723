"""Section `plan`: a robot acts."""
