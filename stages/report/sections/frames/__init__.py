"""Section `frames`: what was recorded, with its masks."""
