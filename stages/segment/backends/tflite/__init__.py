"""Backend `tflite`: instance and semantic networks as TensorFlow Lite files, run by LiteRT."""

from __future__ import annotations

from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.segment.registry import LITERT, RUNTIMES, BackendDeclaration

BACKEND = BackendDeclaration(
    name="tflite",
    summary="a TensorFlow Lite instance or semantic network",
    order=65,
    apart=True,
    needs=frozenset({"color"}),
    of_pictures=True,
    weights="a .tflite file",
    endings=(".tflite",),
    takes=frozenset({"tiles", "semantic_weights"}),
    libraries=RUNTIMES,
    extras=(LITERT,),
    data_files=lambda parameters: LABEL_TABLES,
)
