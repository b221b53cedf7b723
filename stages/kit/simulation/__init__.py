"""pybullet worlds, robots and loaders."""
