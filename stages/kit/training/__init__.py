"""What the trainings of several steps share: how one declares itself, and a run that can be stopped."""
