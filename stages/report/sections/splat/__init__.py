"""Section `splat`: a room as Gaussians, beside what the camera saw, and from all sides."""
