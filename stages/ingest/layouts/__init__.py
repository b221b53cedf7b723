"""What logs look like on disk: each folder is a layout of `ingest`, found because it lies here (docs/LOGS.md)."""
