"""Backend `detector`: boxes of an object detector turned into masks by the depth; floor, walls, ceiling by geometry."""

from __future__ import annotations

from pydantic import Field
from scenewright.stages.kit.stage import Extra, Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class DetectorParameters(Parameters):
    """Options of the backend `detector`."""

    tiles: bool = Field(
        True, description="Detect on overlapping tiles at full resolution too (finds small things, five times slower)"
    )


BACKEND = BackendDeclaration(
    name="detector",
    summary="an ONNX object detector and the depth",
    order=40,
    apart=True,
    needs=frozenset({"color"}),
    weights="an ONNX file",
    parameters=DetectorParameters,
    libraries=("ai-edge-litert",),
    extras=(Extra("ai-edge-litert", "ai_edge_litert", "segment --semantic-weights: pip install ai-edge-litert"),),
)
