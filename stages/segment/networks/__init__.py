"""Published networks as files: what goes in, what comes out, and masks with classes of the vocabulary from that."""
