"""Scenes that others wrote, in URDF, MJCF or SDF, as folders that the physics of this toolkit loads."""
