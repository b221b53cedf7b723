"""A canvas that is one HTML page: three-dimensional, self-contained, without a network."""
