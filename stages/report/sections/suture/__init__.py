"""Section `suture`: needle, thread and throws."""
