"""Tableware in an overhead RGB-D image."""
