"""How frames with depth lie to each other: dense alignment, and the graph of what it says."""
