"""The method of Han 2024, sections 6.2 and 6.3."""
