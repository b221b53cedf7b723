"""Opening artifacts in Rerun, an extra: nothing else in the project imports it."""
