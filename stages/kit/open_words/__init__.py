"""Open words: encoders of pictures and words into one space, and places of a room that a text fits."""
