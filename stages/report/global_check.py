"""The scene before and after the global check: what stands in something else is red."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.cad_scene import CadCandidate, CadScene, Replacement
from scenewright.stages.kit.measurement.cad_candidates import after_check, before_check
from scenewright.stages.kit.measurement.layout_pieces import layout_pieces
from scenewright.stages.kit.measurement.room_penetrations import Penetration, room_penetrations
from scenewright.stages.kit.rendering.surfaces import srgb_to_linear
from scenewright.stages.report.placed_models import ModelShelf
from scenewright.stages.report.surfaces import Model, cad_model

CONFLICT = (0.80, 0.08, 0.07)
"""Colour of objects in conflict (sRGB, 0 to 1)."""
CALM = 0.62
"""How far the colours of what collides with nothing go towards light grey."""
NAMED_PAIRS = 6
"""Most pairs of objects that a caption names."""


@dataclass(frozen=True)
class CheckedScene:
    """One of the two scenes."""

    model: Model
    conflicts: list[Penetration]
    caption: str


def checked_scenes(cad_scene: CadScene, shelf: ModelShelf) -> list[CheckedScene]:
    """Return the scene before and after the global check, or the one after alone where no one recorded the first.

    Conflicts are pairs of replaced objects, and of objects with floor, walls or ceiling, more than 5 mm deep. A model
    that is not at hand is left out of the picture.
    """
    scene = cad_scene.info
    steps: list[tuple[str, Callable[[Replacement], CadCandidate | None]]] = [("After the global check", after_check)]
    if any(r.best_single is not None for r in scene.replacements):
        steps.insert(0, ("Before the global check, every thing by itself", before_check))
    scenes = []
    for title, choose in steps:
        candidates = {r.node: choose(r) for r in scene.replacements if r.decision != "layout"}
        model = cad_model(cad_scene, shelf, candidates)
        if model is not None:
            conflicts = conflicts_of(cad_scene, shelf, candidates)
            models = sum(candidate is not None for candidate in candidates.values())
            caption = _caption(title, conflicts, models)
            scenes.append(CheckedScene(_painted(model, conflicts), conflicts, caption))
    return scenes


def conflicts_of(
    cad_scene: CadScene, shelf: ModelShelf, candidates: dict[str, CadCandidate | None]
) -> list[Penetration]:
    """Return the pairs that are more than 5 mm deep in each other, deepest first."""
    pieces = {node: shelf.pieces(candidate) for node, candidate in candidates.items() if candidate is not None}
    layout = layout_pieces(cad_scene.graph, cad_scene.path("layout"), cad_scene.shell)
    return [pair for pair in room_penetrations(pieces, layout) if pair.collides]


def _painted(model: Model, conflicts: list[Penetration]) -> Model:
    """The model with objects in conflict in red and everything else pale."""
    guilty = {pair.first for pair in conflicts} | {pair.second for pair in conflicts if not pair.layout}
    numbers = [
        number for number, node in model.nodes.items() if node in guilty and model.classes.get(number) is not None
    ]
    red = np.isin(model.soup.instance, numbers)
    pale = srgb_to_linear(np.array([0.88, 0.88, 0.87]))
    colors = np.where(
        red[:, None, None], srgb_to_linear(np.array(CONFLICT)), (1 - CALM) * model.soup.corner_colors + CALM * pale
    )
    names = {number: name for number, name in model.names.items() if number in numbers}
    return replace(model, soup=replace(model.soup, corner_colors=colors.astype(np.float32)), names=names)


def _caption(title: str, conflicts: list[Penetration], models: int) -> str:
    """Say what was compared: CAD models with each other and with the room. Scanned meshes take no part."""
    if not models:
        return f"{title}: there is no CAD model to compare"
    if not conflicts:
        return f"{title}: none of {models} CAD models stands more than 5 mm in another, or in floor, walls or ceiling"
    pairs = [f"{pair.first} in {pair.second} ({1000 * pair.depth:.0f} mm)" for pair in conflicts[:NAMED_PAIRS]]
    and_more = f" and {len(conflicts) - NAMED_PAIRS} more" if len(conflicts) > NAMED_PAIRS else ""
    return f"{title}: {len(conflicts)} conflict{'s' if len(conflicts) > 1 else ''}, red: {', '.join(pairs)}{and_more}"
