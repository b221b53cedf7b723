"""The board: one benchmark whose inputs stay as they are, so that versions can be compared (`make board`)."""
