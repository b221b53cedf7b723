"""Training of the embedded encoder of pictures and words, and what its figures are measured on."""
