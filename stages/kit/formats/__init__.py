"""Readers and writers of the file formats that others already open."""
