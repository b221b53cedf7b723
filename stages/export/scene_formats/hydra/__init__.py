"""Spark-DSG: scene graphs as Hydra keeps them."""

from scenewright.stages.export.scene_registry import SceneFormat
from scenewright.stages.kit.stage import Extra

FORMAT = SceneFormat(
    "hydra",
    order=40,
    file="scene_graph.json",
    summary="scene graph of Hydra's library spark_dsg",
    extra=Extra("spark_dsg", "spark_dsg", "`export scene --to hydra`: pip install 'scenewright[hydra]'"),
    notes=(
        "layer OBJECTS holds every body but floor, walls and ceiling, below one room; an edge between two objects is a "
        "relation of the contact graph, its name in the edge's metadata",
        "Hydra's layers of places and agents are empty: the chain keeps no such thing",
    ),
)
