"""Rooms of the chain to learn in: boxes and joints that actions move, without physics or motions of an arm."""
