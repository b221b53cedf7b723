"""A person cuts: two clicks on a picture are a plane."""
