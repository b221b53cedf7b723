"""Exact rooms for task and motion planning: furnished by a recipe and written without a walk or a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.scene_parts import SurfacePlane
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.synthesize import (
    Catalogue,
    PlacedObject,
    arrange,
    blocked_floor,
    load_recipe,
    object_boxes,
    scene_bodies,
    true_graph,
)


def shut_furniture(things: Sequence[PlacedObject], catalogue: Catalogue) -> tuple[PlacedObject, ...]:
    """Return the things with all doors and drawers closed; what stands on a surface keeps it under its new number."""
    before = {thing.name: thing.furnishing for thing in things}
    closed = {name: catalogue.furnishing(was.model, {}, was.scale) for name, was in before.items()}
    found = []
    for thing in things:
        plane = thing.plane
        if plane is not None and thing.parent in closed:
            plane = same_surface(before[thing.parent].surfaces[plane], closed[thing.parent].surfaces)
        found.append(replace(thing, furnishing=closed[thing.name], plane=plane))
    return tuple(found)


def same_surface(plane: SurfacePlane, surfaces: Sequence[SurfacePlane]) -> int:
    """Return the number of the level surface nearest to `plane`. Raises BadInput when there is none."""
    level = [number for number, surface in enumerate(surfaces) if surface.horizontal]
    if not level:
        raise BadInput("closed furniture has no level surface where it carries something")
    center = np.asarray(plane.center)
    return min(level, key=lambda number: float(np.linalg.norm(np.asarray(surfaces[number].center) - center)))


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
        arrangement = replace(arrangement, objects=shut_furniture(arrangement.objects, catalogue))
    boxes = object_boxes(arrangement)
    graph = true_graph(arrangement, boxes)
    root.mkdir(parents=True, exist_ok=True)
    write_scene_bundle(root, scene_bodies(arrangement, boxes, graph), graph)
    return InteractiveScene(root)
