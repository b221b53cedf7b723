"""A house of others: rooms furnished with other people's models, rendered by another renderer, with true masks."""
