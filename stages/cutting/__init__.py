"""Cutting things into fragments, learned from demonstrations (Han 2024, chapter 6)."""
