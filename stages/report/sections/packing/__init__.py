"""Section `packing`: boxes and a basket."""
