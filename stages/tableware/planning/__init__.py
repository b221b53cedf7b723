"""What can be done with tableware, what it costs, and what to do next."""
