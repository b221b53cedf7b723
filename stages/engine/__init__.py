"""Running steps: keys, digests, whole-or-not-at-all folders, resume, pipelines."""
