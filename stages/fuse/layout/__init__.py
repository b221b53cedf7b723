"""What bounds a room, by geometry: before any mask counts."""
