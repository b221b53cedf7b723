"""Language in a splat: what pieces of pictures say, kept at places and sizes in the room."""
