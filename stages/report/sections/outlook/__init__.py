"""Section `outlook`: what can be relied on, what cannot, what was not seen, what to do next."""
