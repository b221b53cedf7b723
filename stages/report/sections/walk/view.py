"""The map and the scene that was made of it on one page in three dimensions, one faded into the other."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.explaining.sources import sentences
from scenewright.stages.kit.viewing.canvas import SHELL
from scenewright.stages.kit.viewing.graphs import DRAWN, draw_graph
from scenewright.stages.kit.viewing.maps import LAYERS, draw_panoptic_map
from scenewright.stages.kit.viewing.page.page_canvas import PageCanvas, script_digests
from scenewright.stages.kit.viewing.scenes import draw_settling, trust_of_models
from scenewright.stages.report.page import Page

LARGEST = 9_000_000
"""Bytes of the page within the page: the pictures want the rest of 15 MB."""
SCENE = "scene"


def view(page: Page) -> dict[str, Any] | None:
    """Return the page, and the digests of the scripts that may run in it; None when there is nothing to walk into."""
    panoptic_map = page.given("panoptic_map", PanopticMap)
    scene, graph = page.given("interactive_scene", InteractiveScene), page.given("contact_graph", ContactGraph)
    if scene is not None and not scene.path(scene.info.combined_file).is_file():
        scene = None
    has_mesh = panoptic_map is not None and panoptic_map.path("mesh.ply").is_file()
    if not has_mesh and scene is None:
        return None
    canvas = PageCanvas("The room")
    if panoptic_map is not None and has_mesh:
        of_scene = (SCENE, SHELL, *DRAWN)
        canvas.view("scan", *(layer for layer in LAYERS if layer != "color"), "boxes", *of_scene)
        draw_panoptic_map(panoptic_map, canvas, *of_scene)
    file = scene.graph if scene is not None else graph.info if graph is not None else None
    if scene is not None:
        draw_settling(scene, canvas, SCENE)
    if file is not None:
        cad_scene = page.given("cad_scene", CadScene)
        trusted = trust_of_models(cad_scene.info) if cad_scene is not None else None
        name = "scene" if scene is not None else "graph"
        layers = LAYERS if scene is not None else tuple(layer for layer in LAYERS if layer != "color")
        draw_graph(file, canvas, *layers, trusted=trusted, name=name, boxes=not has_mesh)
    canvas.explain(sentences(page.sources))
    text = canvas.page()
    if len(text) > LARGEST:
        return {"walk_page": "", "walk_size": f"{len(text) / 1e6:.0f} MB", "scripts": ()}
    return {"walk_page": text.decode("utf-8"), "walk_size": "", "scripts": script_digests()}
