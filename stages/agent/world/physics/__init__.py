"""The physics world: pybullet apartments, rendered cameras, an arm that grasps what its own cameras saw."""
