"""How well fragments match a goal."""
