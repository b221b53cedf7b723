"""Ground truth of data sets that others annotated."""
