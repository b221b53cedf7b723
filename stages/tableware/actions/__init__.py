"""What can be done on a table: one file an action, found by its place, whose ACTION is its class (Srinivas 2024,
equations 6.1 to 6.5)."""
