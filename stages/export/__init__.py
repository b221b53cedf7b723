"""`export`: a sequence written back in the layouts of other tools."""
