"""Rooms from seeded recipes, rendered as RGB-D logs with everything that is true of them."""
