"""Who decides what is done next: one file a policy, found by its place, whose POLICY declares it."""
