"""Kinematics, collision and path planning."""
