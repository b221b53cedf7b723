"""Backend `onnx`: instance and panoptic networks as ONNX files, run by ONNX Runtime."""

from __future__ import annotations

from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.stage import Extra
from scenewright.stages.segment.registry import BackendDeclaration

BACKEND = BackendDeclaration(
    name="onnx",
    summary="an ONNX instance or panoptic network",
    order=70,
    needs=frozenset({"color"}),
    weights="an ONNX file",
    libraries=("onnxruntime",),
    extras=(Extra("onnxruntime", "onnxruntime", "segment --backend onnx: pip install onnxruntime"),),
    data_files=lambda parameters: LABEL_TABLES,
)
