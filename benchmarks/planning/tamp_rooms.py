"""Exact rooms for task and motion planning: furnished by a recipe and written without a walk or a camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from schemas.cad_library import CadLibrary
from schemas.interactive_scene import InteractiveScene
from stages.kit.formats.scene_bundle import write_scene_bundle
from stages.synthesize.arrangement import arrange
from stages.synthesize.furniture import Catalogue
from stages.synthesize.recipes import load_recipe
from stages.synthesize.truth import object_boxes, scene_bodies, true_graph
from stages.synthesize.viewpoints import blocked_floor


def exact_room(
    library: CadLibrary, recipe: str, seed: int, root: Path, *, shut: bool = False, clutter: str = "medium"
) -> InteractiveScene:
    """Write the room that `synthesize` makes of a recipe and seed as an interactive scene into `root`; return it.

    The same bodies and graph as in `room/` of its ground truth; with `shut`, all doors and drawers are closed
    afterwards, over what stands inside. Raises BadInput as `synthesize` does.
    """
    catalogue = Catalogue(library)
    arrangement = arrange(load_recipe(recipe), catalogue, clutter, seed, blocked_floor)
    if shut:
        closed = [
            replace(thing, furnishing=catalogue.furnishing(thing.furnishing.model, {}, thing.furnishing.scale))
            for thing in arrangement.objects
        ]
        arrangement = replace(arrangement, objects=tuple(closed))
    boxes = object_boxes(arrangement)
    graph = true_graph(arrangement, boxes)
    root.mkdir(parents=True, exist_ok=True)
    write_scene_bundle(root, scene_bodies(arrangement, boxes, graph), graph)
    return InteractiveScene(root)
