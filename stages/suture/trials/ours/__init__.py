"""Our mechanisms; each can be exchanged for the thesis's."""
