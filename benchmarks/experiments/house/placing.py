"""What stands for the things of a house: their own models where the library has them, and which joints are true."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene, Replacement
from scenewright.stages.evaluate import (
    ModelShape,
    PlacedShape,
    alignment_error,
    model_shape,
    placed_candidate,
    placed_joints,
    retrieval_rank,
)
from scenewright.stages.evaluate.joint_errors import joint_errors
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh, read_model

from benchmarks.experiments.house.furnishing import House
from benchmarks.experiments.house.models import MODELS

SAME_SIZE, SAME_AREA = 0.001, 0.05
"""Edges of boxes [m] and surfaces [share] of one shape in two files differ by less: nobody sees their insides."""


@dataclass(frozen=True)
class Stand:
    """What stands for one true thing of which the library has the very model."""

    thing: str
    decision: str
    """`missed` where no entity is the thing; else that of `cad`."""
    chosen: str = ""
    """Model of the library, stretched or not."""
    own: bool = False
    """Whether that is the thing's own, or the same in another file of the set."""
    rank: int | None = None
    """Place of its own model among the candidates."""
    translation: float | None = None
    """[m]"""
    rotation: float | None = None
    """[degrees], modulo the model's symmetry."""
    scale: float | None = None
    """Largest |ratio - 1| of the extents."""
    right: bool = False
    """Its own model within 0.2 m, 20 degrees, and 20 % of every extent."""


@cache
def _shape(folder: Path) -> ModelShape:
    return model_shape(folder)


def _same(first: ModelShape, second: ModelShape) -> bool:
    """Whether two models have the same box and as much surface: one kettle comes alone, painted, and in kitchens."""
    (low, high), (other_low, other_high) = first.closed_bounds, second.closed_bounds
    area, other = (sum(part.area for part in shape.parts.values()) for shape in (first, second))
    boxes_agree = np.allclose(high - low, other_high - other_low, rtol=0, atol=SAME_SIZE)
    return boxes_agree and abs(area - other) <= SAME_AREA * other


def true_places(house: House, library: CadLibrary, world_from_log: np.ndarray) -> dict[str, PlacedShape]:
    """Return thing -> its model as it stands; `library`: one that has the models of the house; `world_from_log`
    (4, 4)."""
    places = {}
    for thing in house.things:
        model = MODELS[thing.model]
        folder = model_folder(library, model.id)
        at_rest = posed_mesh(folder, read_model(folder), {}, model.scale)
        pose, _, _ = trimesh.registration.procrustes(
            at_rest.vertices, thing.mesh.vertices, reflection=False, scale=False
        )
        places[thing.name] = PlacedShape(_shape(folder), world_from_log @ pose, model.scale)
    return places


def replaced(
    scene: CadScene, name_of: Mapping[int, str]
) -> Iterator[tuple[str | None, Replacement, PlacedShape | None]]:
    """Yield every node's thing (None where it is none), what stands for it, and that model as it stands.

    `name_of`: instance of the map -> name of the thing.
    """
    things = {node.id: name_of.get(node.instance) for node in scene.graph.nodes if node.node_type != "scene"}
    for entry in scene.info.replacements:
        placed = None
        if entry.decision == "cad" and entry.chosen is not None:
            shape = _shape(scene.path("models") / entry.chosen.model_id)
            placed = placed_candidate(entry.chosen, {entry.chosen.model_id: shape}, entry.held)
        yield things.get(entry.node), entry, placed


def stands(scene: CadScene, name_of: Mapping[int, str], places: Mapping[str, PlacedShape]) -> tuple[Stand, ...]:
    """Return what stands for every thing of `places` in a scene made with a library that has their models."""
    found = {}
    for name, entry, placed in replaced(scene, name_of):
        if name is None or name not in places:
            continue
        true = places[name]
        rank = retrieval_rank(entry, true.shape.model_id)
        if placed is None or entry.chosen is None:
            found[name] = Stand(name, entry.decision, rank=rank)
            continue
        error, chosen = alignment_error(true, placed), entry.chosen.library_model
        own = chosen == true.shape.model_id or (not entry.chosen.stretched_from and _same(placed.shape, true.shape))
        right = own and error.succeeds(every_axis=True)
        figures = (error.translation, float(np.degrees(error.rotation)), error.worst_scale)
        found[name] = Stand(name, "cad", chosen, own, rank, *figures, right=right)
    return tuple(found.get(name, Stand(name, "missed")) for name in places)


def joints_given(
    scene: CadScene, name_of: Mapping[int, str], places: Mapping[str, PlacedShape]
) -> tuple[int, tuple[str, ...]]:
    """Return how many joints move in a scene, and the things whose joints stand for none of their own, with how many.

    A joint is false where its node is no thing, or where no joint of the thing's model is of its kind.
    """
    given, false = 0, []
    for name, entry, placed in replaced(scene, name_of):
        if placed is None or not placed.joints:
            continue
        given += len(placed.joints)
        true = placed_joints(places[name]) if name is not None and name in places else []
        partners = sum(error.partner is not None for error in joint_errors(true, placed_joints(placed)))
        if len(placed.joints) > partners:
            false.append(f"{len(placed.joints) - partners} joints of {entry.node} ({name})")
    return given, tuple(false)
