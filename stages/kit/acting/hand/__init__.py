"""What a two-finger hand can take hold of."""
