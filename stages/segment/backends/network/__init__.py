"""Backend `network`: our own RGB-D panoptic network, trained on generated rooms (docs/SEGMENTATION.md)."""

from __future__ import annotations

from scenewright.stages.segment.registry import BackendDeclaration

BACKEND = BackendDeclaration(
    name="network",
    summary="a compact RGB-D network of our own, trained on generated rooms",
    order=50,
    apart=True,
    automatic=True,
    weights="a .safetensors checkpoint of our own, where the one that comes with the project is not wanted",
    endings=(".safetensors",),
    libraries=("torch",),
    data_files=lambda parameters: ("networks/panoptic.safetensors",),
)
