"""What the robot can do: each file is an action of `plan`, found because it lies here (docs/PLANNING.md)."""
