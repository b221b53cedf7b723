"""Checked expressions over what is perceived: reading, evaluating, saying."""
