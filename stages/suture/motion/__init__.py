"""The motion primitives of a suture throw as paths of tool poses."""
