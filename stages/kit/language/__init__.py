"""Language models: one chat, several backends, replies that are data (docs/INTERPRET.md)."""
