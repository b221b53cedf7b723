"""Contact graphs, over the meshes of the map they were made from."""

from __future__ import annotations

from scenewright.cli.viewing.inputs import input_artifact
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.graphs import draw_graph_over


def draw_contact_graph(graph: ContactGraph, canvas: Canvas) -> None:
    """Draw the graph over the meshes of its map, where that is still there."""
    draw_graph_over(graph.info, input_artifact(graph, PanopticMap), canvas)
