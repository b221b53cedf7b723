"""The planar kitchen: bodies, gripper, water and the seven actions, in 2-D physics."""
