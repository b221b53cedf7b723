"""A desk to put an artifact right at: its page, and a server of this machine alone that writes edits.toml."""
