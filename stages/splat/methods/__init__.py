"""Ways of building a splat: each a file with a `METHOD`."""
