"""Figures of needle poses and of trials, and their tables and plots."""
