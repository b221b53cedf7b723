"""Predicates as data: checked expressions over what is perceived, and their evaluation."""
