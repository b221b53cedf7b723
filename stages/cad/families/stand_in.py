"""Ours: a thing that no model of the library explains is made of the parts of its family, fitted to what was seen.

A form stands for its thing where it explains clearly more of it than the best model does, and its parts are snapped to
surface, so that it is as large as the thing. It is a model like those of the library, made for one node.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadModel, ModelState
from scenewright.schemas.cad_scene import Inferred
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.scene_parts import Joint
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.cad.candidates import Shortlist
from scenewright.stages.cad.families.fitting import FAMILIES, Fitted, explains_clearly_more, fit, share, surface_to_read
from scenewright.stages.cad.families.forms import INFERRED_WORDS, Form, Piece, Reading
from scenewright.stages.cad.made_models import BODY, FAMILY, part_of, plane_of
from scenewright.stages.cad.model_surfaces import ModelSurface, load_surface, robust_error, to_model, to_world
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.cad.target import Target, stands_in_wall, unsupported_children
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.formats.model_writer import write_model_folder
from scenewright.stages.kit.geometry.solids import Solid, hull_or_box, volume
from scenewright.stages.kit.geometry.substances import substance_of

INFERRED = "inferred"
"""Entry of a recipe: which of the pieces nobody saw, by number."""
WORKED_WITH = frozenset({"monitor", "keyboard", "mouse", "laptop"})
"""What stands on a desk, and tells it from a table."""
CONTAINS = frozenset({"shelf", "wall_shelf"})
"""Classes in which things stand."""
HANG = frozenset({"cabinet"})
"""Families whose things may hang."""
BESIDE, ALONG = 0.08, 0.12
"""A handle of a model is the bar that was seen where it is so near to it, across it and along it [m]."""
NEARLY = 0.05
"""A form explains nearly as much as a model where its share is less by no more than this."""
TRUNCATION = 0.05
"""Distances are cut off here when the cost of a form is measured, as those of models are [m]."""


def of_family(
    entry: Shortlist,
    target: Target,
    mesh: EntityMesh,
    said: Mapping[str, float],
    parameters: CadParameters,
    models: Path,
    *,
    may_rename: bool,
) -> tuple[Shortlist, str]:
    """Return the shortlist of a thing with the form of its family, and why that is not first: what does not explain
    clearly more than the best model goes last.

    Its model is written into the folder `models`, its surface added to the target's. `said`: class -> what masks gave
    it a look; `may_rename`: whether shape may say what it is.
    """
    node = entry.node
    unknown = may_rename and not entry.placements
    own = [name for name, (classes, _) in FAMILIES.items() if node.class_name in classes]
    tried = list(FAMILIES) if unknown else own
    if not tried or node.box is None:
        return entry, "nothing of its class is of a family"
    if target.around.hangs:
        tried = [name for name in tried if name in HANG]
        if not tried:
            return entry, "it hangs, and what its class is a family of stands"
    reading = surface_to_read(target.around, mesh)
    fits = {name: fit(name, reading) for name in tried}
    found = [fitted for fitted in fits.values() if isinstance(fitted, Fitted)]
    if not found:
        return entry, "; ".join(f"no {name}: {why}" for name, why in fits.items())
    best = likeliest(found, node.class_name, said, reading)
    why_not = ""
    if entry.placements:
        before = explained_by(entry.placements[0], target, reading)
        nearly = best.explained >= share(before, reading.patches) - NEARLY
        denied = nearly and contradicts_handles(entry.placements[0], best.form)
        if not denied and not explains_clearly_more(best.near, before, reading.patches):
            shares = f"{best.explained:.0%} explained, by the model {share(before, reading.patches):.0%}"
            why_not = f"a {best.form.family} of parts is not clearly better: {shares}"
    renamed = node.model_copy(update=class_of(node, best.form, said, carried_by(target)))
    placement, surface = write_form(renamed, best.form, models / f"{node.id}_{best.form.family}")
    target.surfaces[surface.model.id] = surface
    missing = unsupported_children(placement, target.around, parameters)
    allowed = unsupported_children(entry.placements[0], target.around, parameters) if entry.placements else missing
    if stands_in_wall(placement, target, parameters):
        return entry, why_not or "it would stand in a wall"
    if len(missing) > len(allowed):
        return entry, why_not or f"nothing of it would support {', '.join(missing)}"
    cost = robust_error(surface, placement, target.points, target.normals, TRUNCATION)
    if entry.placements:  # what explains more goes first, whatever else models are judged by
        cost = (max if why_not else min)(cost, entry.placements[0].score)
    placement = replace(placement, alignment_error=rms(surface, placement, target), score=cost)
    if why_not:
        return replace(entry, placements=(*entry.placements, placement)), why_not
    reason = f"a {best.form.family} of {best.form.words}; {best.explained:.0%} explained"
    reason += f"; does not quite support {', '.join(missing)}" if missing else ""
    placements = (placement, *entry.placements)
    return replace(entry, node=renamed, placements=placements, reason=reason, carrier=target.around.surface_below), ""


def likeliest(found: Sequence[Fitted], class_name: str, said: Mapping[str, float], reading: Reading) -> Fitted:
    """Return the form that explains most of a thing; of those that do not explain clearly less, the one of its class,
    or else of what masks said most."""

    def trusted(fitted: Fitted) -> tuple[bool, float, float]:
        names = FAMILIES[fitted.form.family][0]
        return class_name in names, max(said.get(name, 0.0) for name in names), fitted.explained

    most = max(found, key=lambda fitted: fitted.explained)
    as_good = [f for f in found if not explains_clearly_more(most.near, f.near, reading.patches)]
    return max(as_good, key=trusted)


def explained_by(placement: Placement, target: Target, reading: Reading) -> np.ndarray:
    """Return (N,) bool: the patches of a surface, world frame, that a placed model explains."""
    surface = target.surfaces[placement.shape.model.id]
    nearest = surface.closest(to_model(placement, reading.patches.points), placement.shape.joints)
    return np.asarray(placement.scale * nearest.distance < reading.within)


def contradicts_handles(placement: Placement, form: Form) -> bool:
    """Whether half of the bars that were seen on a thing, by its form, or more are no handles of a placed model."""
    model = placement.shape.model
    handles = [(np.asarray(j.handle), np.asarray(j.handle_axis)) for j in model.joints if j.handle and j.handle_axis]
    places = to_world(placement, np.array([place for place, _ in handles]).reshape(-1, 3))
    axes = np.array([axis for _, axis in handles]).reshape(-1, 3) @ placement.rotation.T
    seen = [leaf for leaf in form.leaves if leaf.seen]
    missing = 0
    for leaf in seen:
        axis = form.turn @ leaf.handle_axis
        off = places - form.turn @ leaf.handle
        along = off @ axis
        across = np.linalg.norm(off - along[:, None] * axis, axis=1)
        missing += not np.any((across < BESIDE) & (np.abs(along) < ALONG) & (np.abs(axes @ axis) > 0.8))
    return 0 < len(seen) <= 2 * missing


def rms(surface: ModelSurface, placement: Placement, target: Target) -> float:
    """Return the root mean square distance of the vertices of a thing from a placed model [m]."""
    return robust_error(surface, placement, target.points, None, math.inf)


def carried_by(target: Target) -> frozenset[str]:
    """Return the classes of what stands on a thing."""
    graph = target.around.graph
    return frozenset(graph.node(name).class_name for name in graph.children(target.node.id))


def class_of(node: GraphNode, form: Form, said: Mapping[str, float], carried: Collection[str]) -> dict[str, str]:
    """Return what changes in the node of a thing of a form: nothing where its class is of the family; else the class
    that masks said most of those that it may be, that what it carries tells, or the likeliest by its form."""
    classes, _ = FAMILIES[form.family]
    if node.class_name in classes:
        return {}
    worked_at = {"desk"} if WORKED_WITH & frozenset(carried) else set()
    name = max(form.classes, key=lambda each: (said.get(each, 0.0), each in worked_at, -form.classes.index(each)))
    return {"class_name": name, "node_type": load_vocabulary().by_name(name).node}


def inferred_of(placement: Placement, surface: ModelSurface) -> Inferred | None:
    """Return what nobody saw of a placed model of a family, None where all of it was seen."""
    numbers = [int(number) for number in str(surface.model.recipe.get(INFERRED, "")).split()]
    if not numbers:
        return None
    pieces = [to_world(placement, np.asarray(surface.pieces[BODY][number].vertices)) for number in numbers]
    return Inferred(
        what=str(surface.model.recipe["pieces"]).partition(INFERRED_WORDS)[2],
        because="things of its family have them beside what was seen of it, and nobody saw that nothing is there",
        pieces=tuple(tuple(as_vector(np.round(corner, 4)) for corner in piece) for piece in pieces),
    )


def _solids(pieces: Sequence[Piece], origin: np.ndarray) -> list[Solid]:
    return [hull_or_box(np.round(piece.corners - origin, 6)) for piece in pieces]


def write_form(node: GraphNode, form: Form, folder: Path) -> tuple[Placement, ModelSurface]:
    """Write the model of a form and return where it stands, and its surface."""
    shut = [*form.pieces, *(piece for leaf in form.leaves for piece in leaf.pieces)]
    corners = np.concatenate([piece.corners for piece in shut])
    low, high = corners.min(axis=0), corners.max(axis=0)
    origin = np.array([*(0.5 * (low + high))[:2], low[2]])
    solids = _solids(form.pieces, origin)
    moving = [_solids(leaf.pieces, leaf.origin) for leaf in form.leaves]
    mass = substance_of(node.class_name).hull_density * volume(hull_or_box(corners))
    density = mass / sum(volume(solid) for some in (solids, *moving) for solid in some)
    body = part_of(BODY, solids, density)
    parts = [part_of(leaf.name, some, density) for leaf, some in zip(form.leaves, moving, strict=True)]
    joints = tuple(
        Joint(
            name=f"{leaf.name}_joint",
            type=leaf.type,
            part=leaf.name,
            origin=as_vector(leaf.origin - origin),
            axis=as_vector(leaf.axis),
            lower=0.0,
            upper=round(leaf.travel, 4),
            handle=as_vector(leaf.handle - origin),
            handle_axis=as_vector(leaf.handle_axis),
        )
        for leaf in form.leaves
    )
    levels = [piece.level for piece in form.pieces if piece.level is not None]
    state = ModelState(
        joints={joint.name: 0.0 for joint in joints},
        box_minimum=as_vector(low - origin),
        box_maximum=as_vector(high - origin),
        planes=tuple(plane_of(2, True, a - origin, b - origin) for a, b in levels),
    )
    model = CadModel(
        id=folder.name,
        class_name=node.class_name,
        articulated=bool(joints),
        mass=sum(part.properties.mass for part in (body, *parts)),
        states=(state,),
        joints=joints,
        movable=load_vocabulary().by_name(node.class_name).movable,
        contains=bool(joints) or node.class_name in CONTAINS,
        parts=(BODY, *(part.name for part in parts)),
        recipe={FAMILY: form.family, "pieces": form.words, INFERRED: " ".join(map(str, form.inferred))},
    )
    write_model_folder(folder, model, [body, *parts])
    values = {joint.name: leaf.value for joint, leaf in zip(joints, form.leaves, strict=True)}
    shape = shape_of_state(model, state.model_copy(update={"joints": values}))
    placement = Placement(shape, 1.0, form.turn, form.turn @ origin, 0.0, 0.0, 0.0)
    return placement, load_surface(folder, model)
