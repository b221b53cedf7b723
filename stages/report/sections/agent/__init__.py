"""Section `agent`: a robot told in words."""
