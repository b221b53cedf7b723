"""What the words of `splat language` are trained and fitted by."""
