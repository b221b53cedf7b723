"""Backend `detector`: boxes of an object detector turned into masks by the depth."""

from __future__ import annotations

from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.segment.registry import LITERT, RUNTIMES, BackendDeclaration

BACKEND = BackendDeclaration(
    name="detector",
    summary="an ONNX object detector and the depth",
    order=40,
    apart=True,
    needs=frozenset({"color"}),
    weights="an ONNX file",
    endings=(".onnx",),
    takes=frozenset({"tiles", "semantic_weights"}),
    libraries=RUNTIMES,
    extras=(LITERT,),
    data_files=lambda parameters: LABEL_TABLES,
)
