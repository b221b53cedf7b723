"""`make bench-mapping`: the thesis's tables 2.1 to 2.4 on generated rooms, all arms on the same frames and masks."""
