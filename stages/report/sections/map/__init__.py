"""Section `map`: the map from two sides."""
