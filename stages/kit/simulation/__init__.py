"""Physics worlds in pybullet: interactive scenes, robots, grasps."""
