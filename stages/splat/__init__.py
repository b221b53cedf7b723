"""`scenewright splat`: a room as 3-D Gaussians, learned while its pictures arrive (docs/SPLATS.md)."""
