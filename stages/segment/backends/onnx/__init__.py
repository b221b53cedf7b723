"""Backend `onnx`: instance, panoptic and semantic networks as ONNX files, run by ONNX Runtime."""

from __future__ import annotations

from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.stage import Extra
from scenewright.stages.segment.registry import RUNTIMES, BackendDeclaration

BACKEND = BackendDeclaration(
    name="onnx",
    summary="an ONNX instance, panoptic or semantic network",
    order=70,
    needs=frozenset({"color"}),
    of_pictures=True,
    weights="an ONNX file",
    endings=(".onnx",),
    takes=frozenset({"tiles", "semantic_weights"}),
    libraries=RUNTIMES,
    extras=(Extra("onnxruntime", "onnxruntime", "segment --backend onnx: pip install onnxruntime"),),
    data_files=lambda parameters: LABEL_TABLES,
)
