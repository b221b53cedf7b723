"""Where the robot lives: apartments, what goes wrong in them, and the fast world without contact."""
