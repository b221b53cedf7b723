"""Tables that are cleared: the fast simulator and physics."""
