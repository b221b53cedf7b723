"""Language models: one chat, several backends, replies that are data (docs/LANGUAGE.md)."""
