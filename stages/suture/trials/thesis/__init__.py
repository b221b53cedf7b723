"""The mechanisms of the thesis (Srinivas 2024, section 3.2)."""
