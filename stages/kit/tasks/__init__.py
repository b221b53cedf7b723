"""Symbolic task planning: STRIPS, PDDL and search; knows no scenes."""
