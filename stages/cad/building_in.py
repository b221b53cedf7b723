"""Ours: which things become built-ins, and which of these yield to what stands there already."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulation
from scenewright.schemas.cad_scene import Tried
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.cad.built_ins import built_in
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.choosing import may_touch
from scenewright.stages.cad.conflicts import placed_solid
from scenewright.stages.cad.made_models import is_built_in
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import placed_box
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.target import Surroundings, Target, stands_in_wall, unsupported_children
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.boxes import bottom
from scenewright.stages.kit.geometry.convex_solids import Solid, penetration

LARGEST_DROP = 0.05
"""A built-in that ends farther than this above the bottom of its thing would have to drop to stand [m]; by eye."""


def built_in_instead(
    entry: Shortlist,
    target: Target,
    mesh: EntityMesh,
    moved: Sequence[Articulation],
    parameters: CadParameters,
    models: Path,
) -> Shortlist:
    """Return a shortlist with the built-in that a thing without any valid candidate becomes, or with why there is none.

    Its model is written into the folder `models`.
    """
    folder = models / f"{target.node.id}_built_in"
    fitted = built_in(target.around, mesh, moved, folder)
    if isinstance(fitted, str):
        return replace(entry, reason=f"{entry.reason}; not built in: {fitted}")
    placement = fitted.placement
    target.surfaces[placement.shape.model.id] = fitted.surface
    missing = unsupported_children(placement, target.around, parameters)
    why = "it stands in a wall" if stands_in_wall(placement, target, parameters) else ""
    why = why or (f"nothing of it would support {', '.join(missing)}" if missing else "")
    why = why or ("it would end above what it stands on" if hovers(placement, fitted.surface, target.around) else "")
    if why:
        shutil.rmtree(folder)
        return replace(entry, reason=f"{entry.reason}; not built in: {why}")
    fits = f"{fitted.fit.explained:.0%} explained, {1000 * fitted.fit.distance:.0f} mm off"
    reason = (
        f"built in: {fitted.boxes} boxes, {fitted.leaves} leaves, {fits} (its box {1000 * fitted.box_fit.distance:.0f})"
    )
    return replace(entry, placements=(placement,), reason=reason)


def hovers(placement: Placement, surface: ModelSurface, around: Surroundings) -> bool:
    """Whether a built-in of a thing that stands, of which only boards are full, would have to drop to do so."""
    box = around.node.box
    if around.hangs or box is None:
        return False
    return bottom(placed_box(placement, surface)) - bottom(box) > LARGEST_DROP


def yielded(entry: Shortlist) -> Shortlist:
    """Return the shortlist of a built-in that stood in something else."""
    tried = Tried(way="built_in", because="it would stand in something else")
    return replace(entry, placements=(), reason=f"not built in: {tried.because}", tries=(*entry.tries[:-1], tried))


def colliding_built_ins(
    graph: ContactGraphFile,
    chosen: Mapping[str, Placement],
    surfaces: Mapping[str, ModelSurface],
    obstacles: Mapping[str, Solid],
    parameters: CadParameters,
) -> set[str]:
    """Return the built-ins that would stand in a model, in a thing that keeps its mesh, or in a larger built-in."""
    touching = may_touch(graph)
    built = [name for name, placement in chosen.items() if is_built_in(placement.shape.model)]
    layout = {node.id for node in graph.nodes if node.node_type == "layout"}
    solids = {name: solid for name, solid in obstacles.items() if name not in layout}
    solids |= {name: placed_solid(chosen[name], _of(surfaces, chosen, name)) for name in chosen if name not in built}
    colliding = set()
    for name in sorted(built, key=lambda name: (-float(np.prod(chosen[name].shape.size)), name)):
        solid = placed_solid(chosen[name], _of(surfaces, chosen, name))
        others = [other for key, other in solids.items() if frozenset((key, name)) not in touching]
        if any(penetration(solid, other).depth > parameters.collision_tolerance for other in others):
            colliding.add(name)
        else:
            solids[name] = solid
    return colliding


def _of(surfaces: Mapping[str, ModelSurface], chosen: Mapping[str, Placement], name: str) -> ModelSurface:
    return surfaces[chosen[name].shape.model.id]
