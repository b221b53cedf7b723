"""Section `walk`: the room in three dimensions, to walk into."""
