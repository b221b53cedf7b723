"""Advice is tried: every message that names an option or a command, what brings it up, and what following it gives."""
