"""Section `cutting`: a plan of cuts, and what came of it on a board."""
