"""The ways in which something is sought that may stand for a thing, in order; each says what came of it, and why.

A way gets the shortlist as those before it left it and returns its own. A method says which ways it knows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenewright.schemas.articulations import Articulation
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.cad_scene import Tried, Way
from scenewright.stages.cad.building_in import built_in_instead
from scenewright.stages.cad.built_ins import may_be_built_in
from scenewright.stages.cad.candidates import Shortlist, shortlist
from scenewright.stages.cad.families.stand_in import of_family
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.model_surfaces import ModelSurface, load_surface
from scenewright.stages.cad.recognition import is_doubtful, might_be, recognised
from scenewright.stages.cad.stretching import with_stretched
from scenewright.stages.cad.target import Target
from scenewright.stages.kit.formats.cad_models import model_folder
from scenewright.stages.kit.formats.entity_meshes import EntityMesh


@dataclass(frozen=True)
class Thing:
    """What stands in for something, and what may be asked for it."""

    target: Target
    mesh: EntityMesh
    """As it was mapped."""
    library: CadLibrary
    moved: Sequence[Articulation]
    """What the log shows in two states."""
    said: Mapping[str, float]
    """Class -> mean score that masks gave it a look."""
    named_by_hand: bool
    """Whether somebody gave it its class."""
    made: Path
    """Folder of models that are made for it."""


Seek = Callable[[Shortlist, Thing, CadMethod], tuple[Shortlist, str]]
"""Shortlist so far -> shortlist, and why nothing new came of it; empty where something did."""


def sought(thing: Thing, method: CadMethod) -> Shortlist:
    """Return what may stand for a thing, by all ways of a method; its own mesh where that is empty."""
    entry = Shortlist(thing.target.node, (), {}, "")
    for way in method.ways:
        before = entry
        entry, why_not = SEEKERS[way](before, thing, method)
        entry = replace(entry, tries=(*before.tries, _told(way, before, entry, why_not)))
    return entry


def load_surfaces(library: CadLibrary, models: Sequence[CadModel], surfaces: dict[str, ModelSurface]) -> None:
    """Add the surfaces of models to those that are loaded."""
    for model in models:
        if model.id not in surfaces:
            surfaces[model.id] = load_surface(model_folder(library, model.id), model)


def _told(way: Way, before: Shortlist, after: Shortlist, why_not: str) -> Tried:
    """Return what is recorded of a way: what it puts first, if that is something else, and why."""
    if why_not or not after.placements or after.placements is before.placements:
        return Tried(way=way, because=why_not or after.reason)
    best = after.placements[0]
    count = len(after.placements)
    because = f"{count} fit, the best costs {1000 * best.score:.0f} mm" if way == "library" else after.reason
    return Tried(way=way, because=because, model_id=best.shape.model.id, score=round(best.score, 6))


def _in_library(entry: Shortlist, thing: Thing, method: CadMethod) -> tuple[Shortlist, str]:
    return shortlist(thing.target, method), ""


def _stretched(entry: Shortlist, thing: Thing, method: CadMethod) -> tuple[Shortlist, str]:
    if not thing.target.models:
        return entry, "there is no model to stretch"
    longer = with_stretched(entry, thing.target, method, thing.library)
    same = longer is entry
    return longer, "no model stretched to its size is better by more than the margin of the choice" if same else ""


def _by_shape(entry: Shortlist, thing: Thing, method: CadMethod) -> tuple[Shortlist, str]:
    if thing.named_by_hand:
        return entry, "somebody gave it its name"
    if not is_doubtful(entry, method):
        return entry, "a model of its class fits it"
    if thing.target.around.floats:
        return entry, "nothing is known to carry it, so that part of its shape is missing"
    alike = [model for model in thing.library.info.models if might_be(model, thing.target)]
    load_surfaces(thing.library, alike, thing.target.surfaces)
    renamed = recognised(entry, thing.target, alike, method)
    return renamed, "no one class fits well, and by far better than all others" if renamed is entry else ""


def _of_family(entry: Shortlist, thing: Thing, method: CadMethod) -> tuple[Shortlist, str]:
    target, mesh, may_rename = thing.target, thing.mesh, not thing.named_by_hand
    return of_family(entry, target, mesh, thing.said, method.parameters, thing.made, may_rename=may_rename)


def _built_in(entry: Shortlist, thing: Thing, method: CadMethod) -> tuple[Shortlist, str]:
    if entry.placements:
        return entry, "a model fits it"
    if not may_be_built_in(entry.node):
        return entry, "nothing of its class and size is built in"
    built = built_in_instead(entry, thing.target, thing.mesh, thing.moved, method.parameters, thing.made)
    return built, "" if built.placements else built.reason.removeprefix(f"{entry.reason}; ")


SEEKERS: Mapping[Way, Seek] = {
    "library": _in_library,
    "stretched": _stretched,
    "by_shape": _by_shape,
    "family": _of_family,
    "built_in": _built_in,
}
"""In the order in which they are tried."""
