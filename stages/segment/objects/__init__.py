"""Class-agnostic objects of one RGB-D frame: arrays in, labels out."""
