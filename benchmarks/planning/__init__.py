"""Planning beside named peers: motion (and task and motion) queries, one table."""
