"""Which of its candidates every object gets, so that the scene as a whole can exist (Han 2024, section 2.4.4)."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.cad.arranging import Arrangement, arrange
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.conflicts import Selection, min_conflicts, placed_solid
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.convex_solids import Solid, penetration


def may_touch(graph: ContactGraphFile) -> set[frozenset[str]]:
    """Return pairs that are no collision: parent and child, and what else touches by nature."""
    return {frozenset((link.source, link.target)) for link in graph.links if link.relation != "proximal"}


def select(
    graph: ContactGraphFile,
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    method: CadMethod,
    random: np.random.Generator,
) -> tuple[dict[str, Placement], Selection]:
    """Choose one candidate for each object that has any, by min-conflicts."""
    names = [name for name, entry in shortlists.items() if entry.placements]
    touching = may_touch(graph)
    solids: dict[tuple[int, int], Solid] = {}
    depths: dict[tuple[int, int, int, int], float] = {}

    def solid(i: int, a: int) -> Solid:
        if (i, a) not in solids:
            placement = shortlists[names[i]].placements[a]
            solids[i, a] = placed_solid(placement, surfaces[placement.shape.model.id])
        return solids[i, a]

    def depth(i: int, a: int, j: int, b: int) -> float:
        if frozenset((names[i], names[j])) in touching:
            return 0.0
        if i > j:
            i, a, j, b = j, b, i, a
        if (i, a, j, b) not in depths:
            depths[i, a, j, b] = penetration(solid(i, a), solid(j, b)).depth
        return depths[i, a, j, b]

    counts = []
    for name in names:
        counts.append(method.eligible([placement.score for placement in shortlists[name].placements]))
    selection = min_conflicts(
        counts,
        depth,
        tolerance=method.parameters.collision_tolerance,
        iterations=method.parameters.conflict_iterations,
        random=random,
    )
    chosen = {name: shortlists[name].placements[k] for name, k in zip(names, selection.choice, strict=True)}
    return chosen, selection


def adjust(
    graph: ContactGraphFile,
    chosen: dict[str, Placement],
    shortlists: dict[str, Shortlist],
    surfaces: dict[str, ModelSurface],
    obstacles: dict[str, Solid],
    levels: dict[str, float],
    method: CadMethod,
) -> tuple[Arrangement, int]:
    """Put the chosen models into the scene; returns it and the pairs that still collide."""
    parameters = method.parameters
    margin = 2 * parameters.choice_margin
    alternatives = {
        name: [p for p in shortlists[name].placements if p.score <= shortlists[name].placements[0].score + margin]
        for name in chosen
    }
    arranged = arrange(
        graph,
        chosen,
        method.placer(alternatives, surfaces),
        obstacles,
        levels=levels,
        area_threshold=parameters.area_threshold,
    )
    touching = may_touch(graph)
    solids = {name: placed_solid(p, surfaces[p.shape.model.id]) for name, p in arranged.placements.items()}
    names = sorted(solids)
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :] if frozenset((a, b)) not in touching]
    return arranged, sum(penetration(solids[a], solids[b]).depth > parameters.collision_tolerance for a, b in pairs)
