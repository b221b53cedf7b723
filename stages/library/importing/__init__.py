"""Reading models of other people: one file a format, all of them into a SourceModel (source_model.py)."""
