"""`make llm3`: box packing by proposals and motion-planning feedback; tables 4.1 and 4.2 (Han 2024), harder suites."""
