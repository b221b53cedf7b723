"""Ours: a model in none of the library's sizes, lengthened along its own axes until it is as large as what was seen.

The library has a bench of one length and the room one of another: at one scale for all axes a stand-in is too high or
too short, lies in what is beside it, or is none. Digital cousins are made as large as their twins in the same way (Dai
et al., CoRL 2024). A stretched model counts as much worse as it is stretched, and stands only for what no
model of the library fits in size; upright and shut, as it is not known what an open door's box says of the body.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadLibrary, CadModel, ModelState
from scenewright.schemas.scene_parts import Joint, SurfacePlane
from scenewright.stages.cad.candidates import Shortlist, shortlist
from scenewright.stages.cad.method import CadMethod
from scenewright.stages.cad.model_surfaces import PLAIN, ModelSurface, surface_of
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import is_upright, size_misfit
from scenewright.stages.cad.target import Target
from scenewright.stages.kit.formats.cad_models import load_collision_parts, load_visual_parts, model_folder
from scenewright.stages.kit.formats.model_writer import PartGeometry, write_model_folder
from scenewright.stages.kit.formats.part_colors import vertex_colors
from scenewright.stages.kit.geometry.solids import Solid, mass_properties, volume

SOURCE, FACTORS = "stretched_from", ("stretched_x", "stretched_y", "stretched_z")
"""Entries of a recipe: the id in the library, and the factors along the model's axes."""
AS_LARGE = 0.02
"""A model whose extents are off by no more than this is as large as what was seen [m, root mean square]."""
ALONG_AXES = 0.999
"""Cosine from which on an axis of a joint lies along one of the model's: others would bend."""


def source_of(model: CadModel) -> str | None:
    """Return the id of the model of the library that this one was stretched from, None where it was not."""
    return str(model.recipe[SOURCE]) if SOURCE in model.recipe else None


def with_stretched(entry: Shortlist, target: Target, method: CadMethod, library: CadLibrary) -> Shortlist:
    """Return the shortlist with the best stretched model where all others are more than hardly worse.

    Models of the thing's own class are stretched, where the library has any, else those that stand in for it. The
    surface of a model that is taken is added to the target's.
    """
    box = target.node.box
    if box is None or (entry.placements and not _is_off(entry, np.asarray(box.size))):
        return entry
    same_class = [model for model in target.models if model.class_name == target.node.class_name]
    stretched_surfaces = {}
    for model in same_class or target.models:
        factors = factors_for(model, np.asarray(box.size), method.parameters)
        if factors is not None:
            longer = stretched(model, factors, f"{model.id}_for_{target.node.id}")
            stretched_surfaces[longer.id] = stretched_surface(longer, model_folder(library, model.id))
    if not stretched_surfaces:
        return entry
    surfaces = target.surfaces | stretched_surfaces
    tried = replace(target, models=[surface.model for surface in stretched_surfaces.values()], surfaces=surfaces)
    placed = [
        replace(p, score=p.score + method.parameters.scale_weight * anisotropy(p.shape.model))
        for p in shortlist(tried, method).placements
        if is_upright(p) and not any(p.shape.joints.values())
    ]
    best = min(placed, key=lambda placement: placement.score, default=None)
    if best is None or (entry.placements and entry.placements[0].score <= best.score + method.parameters.choice_margin):
        return entry
    target.surfaces[best.shape.model.id] = stretched_surfaces[best.shape.model.id]
    by = " x ".join(f"{factor:.2f}" for factor in factors_of(best.shape.model))
    reason = f"{best.shape.model.recipe[SOURCE]} stretched by {by}"
    return replace(entry, placements=(best, *entry.placements), reason=reason)


def _is_off(entry: Shortlist, size: np.ndarray) -> bool:
    return size_misfit(size, entry.placements[0]) > AS_LARGE


def factors_for(model: CadModel, size: np.ndarray, parameters: CadParameters) -> np.ndarray | None:
    """Return the factors (3,) that make a shut, upright model as large as a box of `size` (3,) [m], its front along x
    or y of the box, whichever stretches it less; None where that is more than a scale may be, or bends a joint."""
    state = model.states[0]
    model_size = np.subtract(state.box_maximum, state.box_minimum)
    if np.any(model_size <= 0) or np.any(size <= 0) or not all(_lies_along_axes(joint) for joint in model.joints):
        return None
    factors = min((size / model_size, size[[1, 0, 2]] / model_size), key=lambda each: float(np.ptp(np.log(each))))
    fits = np.all((factors >= parameters.minimum_scale) & (factors <= parameters.maximum_scale))
    return factors if fits else None


def _lies_along_axes(joint: Joint) -> bool:
    return bool(np.abs(joint.axis).max() >= ALONG_AXES * np.linalg.norm(joint.axis))


def factors_of(model: CadModel) -> np.ndarray:
    """Return the factors (3,) that a stretched model was stretched by."""
    return np.array([float(model.recipe[name]) for name in FACTORS])


def anisotropy(model: CadModel) -> float:
    """Return the logarithm of the largest factor over the smallest: 0 for a model of another size."""
    return float(np.ptp(np.log(factors_of(model))))


def stretched(model: CadModel, factors: np.ndarray, name: str) -> CadModel:
    """Return a model stretched by factors (3,) along its axes, as dense as before. Of its states those stay in which
    nothing has turned: a door that is open would not be its own picture, stretched."""
    joints = tuple(stretched_joint(joint, factors) for joint in model.joints)
    turning = {joint.name for joint in model.joints if joint.type == "revolute"}
    states = [_state(s, model.joints, factors) for s in model.states if not any(s.joints.get(n) for n in turning)]
    recipe: dict[str, float | int | str] = {SOURCE: model.id}
    recipe |= {key: round(float(value), 6) for key, value in zip(FACTORS, factors, strict=True)}
    width = None if model.grasp_width is None else model.grasp_width * float(factors[:2].max())
    return model.model_copy(
        update={
            "id": name,
            "mass": model.mass * float(np.prod(factors)),
            "states": tuple(states),
            "joints": joints,
            "grasp_width": width,
            "recipe": {**model.recipe, **recipe},
        }
    )


def stretched_joint(joint: Joint, factors: np.ndarray) -> Joint:
    """Return the joint of a stretched model: angles stay, what slides slides as much farther as it is longer."""
    along = float(factors[int(np.argmax(np.abs(joint.axis)))]) if joint.type == "prismatic" else 1.0
    handle = None if joint.handle is None else as_vector(factors * np.asarray(joint.handle))
    return joint.model_copy(
        update={
            "origin": as_vector(factors * np.asarray(joint.origin)),
            "lower": joint.lower * along,
            "upper": joint.upper * along,
            "handle": handle,
        }
    )


def _state(state: ModelState, joints: Iterable[Joint], factors: np.ndarray) -> ModelState:
    along = {joint.name: float(factors[int(np.argmax(np.abs(joint.axis)))]) for joint in joints}
    return ModelState(
        joints={name: value * along[name] if value else 0.0 for name, value in state.joints.items()},
        box_minimum=as_vector(factors * np.asarray(state.box_minimum)),
        box_maximum=as_vector(factors * np.asarray(state.box_maximum)),
        planes=tuple(stretched_plane(plane, factors) for plane in state.planes),
    )


def stretched_plane(plane: SurfacePlane, factors: np.ndarray) -> SurfacePlane:
    """Return a surface plane of a stretched model: normals by the inverse factors, areas by what that takes."""
    bent = np.asarray(plane.normal) / factors
    length = float(np.linalg.norm(bent))
    center = factors * np.asarray(plane.center)
    normal = bent / length
    return plane.model_copy(
        update={
            "normal": as_vector(normal),
            "offset": -float(normal @ center),
            "area": plane.area * float(np.prod(factors)) * length,
            "center": as_vector(center),
            "corners": tuple(as_vector(factors * np.asarray(corner)) for corner in plane.corners),
        }
    )


def stretched_surface(model: CadModel, folder: Path) -> ModelSurface:
    """Return the surface of a stretched model; `folder`: of the model that it was. Raises BadInput."""
    visual, collision = _meshes(model, folder)
    return surface_of(model, visual, lambda: collision)


def write_stretched(model: CadModel, source: Path, folder: Path) -> None:
    """Write the folder of a stretched model from that of the model that it was. Raises BadInput."""
    visual, collision = _meshes(model, source)
    solids = {
        part: [Solid(np.asarray(m.vertices), np.asarray(m.faces), np.zeros(len(m.faces), bool)) for m in pieces]
        for part, pieces in collision.items()
    }
    density = model.mass / sum(volume(solid) for pieces in solids.values() for solid in pieces)
    geometries = []
    for part in model.parts:
        colored_meshes, colors = by_color(visual[part])
        properties = mass_properties(solids[part], [density] * len(solids[part]))
        geometries.append(
            PartGeometry(part, solids[part], [colors[0]] * len(solids[part]), properties, colored_meshes, colors)
        )
    write_model_folder(folder, model, geometries)


def by_color(mesh: trimesh.Trimesh) -> tuple[list[trimesh.Trimesh], list[tuple[int, int, int]]]:
    """Return a mesh in pieces of one colour (sRGB, 0 to 255) each, and the colours."""
    painted, faces = vertex_colors(mesh), np.asarray(mesh.faces)
    if painted is None:
        return [mesh], [(PLAIN, PLAIN, PLAIN)]
    of_faces = np.round(painted[faces].mean(axis=1)).astype(int)
    colors, which = np.unique(of_faces, axis=0, return_inverse=True)
    pieces = [trimesh.Trimesh(mesh.vertices, faces[which == k], process=False) for k in range(len(colors))]
    for piece in pieces:
        piece.remove_unreferenced_vertices()
    return pieces, [(int(r), int(g), int(b)) for r, g, b in colors]


def _meshes(model: CadModel, folder: Path) -> tuple[dict[str, trimesh.Trimesh], dict[str, list[trimesh.Trimesh]]]:
    """Return the visual meshes and collision pieces of a stretched model, part frames."""
    visual, collision = load_visual_parts(folder), load_collision_parts(folder)
    for mesh in (*visual.values(), *(piece for pieces in collision.values() for piece in pieces)):
        mesh.vertices = factors_of(model) * np.asarray(mesh.vertices)
    return visual, collision
