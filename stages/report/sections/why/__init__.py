"""Section `why`: the reasons of every entity."""
