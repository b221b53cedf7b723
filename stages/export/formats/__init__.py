"""What a sequence can be written as: each folder is a format of `export`, found because it lies here."""
