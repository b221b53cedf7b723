"""Step `ingest`: a robot's RGB-D log becomes a sequence in our conventions."""
