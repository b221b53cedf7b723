"""The steps `agent run`, `replay` and `evaluate`: a mobile manipulator told in words (Han 2024, chapter 3)."""
