"""What the backends of `segment` are trained and fitted by."""
