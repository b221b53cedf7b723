"""Who writes the programs: a language model, or rules of ours."""
