"""Section `figures`: what was measured."""
