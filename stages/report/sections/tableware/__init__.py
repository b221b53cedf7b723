"""Section `tableware`: a table being cleared."""
