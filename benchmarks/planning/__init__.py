"""Planning beside named peers: motion, and task and motion."""
