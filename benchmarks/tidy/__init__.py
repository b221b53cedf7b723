"""Fits to what the thesis prints of clearing tables, and to what experiments measured."""
