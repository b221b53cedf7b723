"""Section `cost`: time and memory of every step."""
