"""One reading of words: a phrase becomes classes, attributes, relations and wants."""
