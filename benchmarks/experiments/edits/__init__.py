"""Edits by hand, applied again to maps that were fused with other parameters."""
