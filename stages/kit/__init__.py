"""What several steps share, and nothing else."""
