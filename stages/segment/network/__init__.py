"""Backend `network`: our own RGB-D panoptic network, trained on generated rooms and tabletops (docs/NETWORK.md)."""
