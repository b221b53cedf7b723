"""Why things of artifacts are what they are, in sentences: a pure function for each kind, out of what it records."""
