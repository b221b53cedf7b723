"""How the network of `--backend network` is made: data, training, evaluation (docs/SEGMENTATION.md)."""
