"""The tables of the theses, and what the real logs give."""
