"""The rows, by where their messages stand."""
