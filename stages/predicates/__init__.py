"""InterPreT: what words mean is learned from corrections, and plans are made with it (docs/INTERPRET.md)."""
