"""From placed parts to a CAD model: its record with states and planes, masses, geometry of every part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import Affordances, CadModel, ModelState
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Joint
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.model_writer import PartGeometry
from scenewright.stages.kit.geometry.solids import mass_properties, volume
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.affordances import affordances
from scenewright.stages.library.importing.painting import painted
from scenewright.stages.library.importing.placing import Part
from scenewright.stages.library.modelling import joint_values, motion
from scenewright.stages.library.surfaces import TOO_INTRICATE, Sections, surface_planes

KNOB_SHARE = 0.2
"""Moving parts smaller than this share of the model's diagonal get no states of their own."""
CONTAINERS = {
    *(
        "cabinet",
        "wall_cabinet",
        "wardrobe",
        "drawer_unit",
        "chest",
        "shelf",
        "fridge",
        "microwave",
        "oven",
        "dishwasher",
    ),
    *("washing_machine", "bin", "box", "toolbox", "sink", "cup", "bowl", "pan", "cooking_pot", "jug", "kettle", "vase"),
}
"""Classes that contain things even where the collision shapes are solid."""
WIDEST_GRASP = 0.08
"""Opening of a two-finger gripper [m]."""
LARGEST_MASS = 1000.0
"""Largest usual mass [kg]: larger ones are questioned, and none is assumed to be larger."""
HEAVIEST_MODEL = 1e9
"""Mass [kg] from which on a model is refused."""
LIGHTEST, HEAVIEST = 5.0, 12000.0
"""Mean density over the collision pieces [kg/m^3]."""
MOST_STATES_OF = 12
"""Joints that get states of their own."""
MOST_PIECES = 1500
"""Most collision pieces of all parts of a model."""
MOST_SECTIONS, MOST_SECTIONS_CLOSED = 100_000, 30_000
"""Most sections of pieces with planes, in all states and in the closed one. An oven of 48 pieces and 20 states takes
20,000."""


@dataclass(frozen=True)
class Assembled:
    """A CAD model with its geometry, and what is to be said about it."""

    model: CadModel
    parts: tuple[PartGeometry, ...]
    affordances: Affordances
    findings: tuple[str, ...]
    collision_pieces: int


def assembled(
    parts: Sequence[Part],
    model_id: str,
    class_name: str,
    *,
    contains: bool | None,
    density: float,
    recipe: dict[str, float | int | str],
) -> Assembled:
    """Return the library's record and geometry of centred parts. Raises BadInput for more pieces than can be judged."""
    if (count := sum(len(part.pieces) for part in parts)) > MOST_PIECES:
        raise BadInput(f"{count} collision pieces, more than {MOST_PIECES}", hint=TOO_INTRICATE)
    findings: list[str] = []
    movable = load_vocabulary().by_name(class_name).movable
    parts = [replace(part, joint=None if part.joint is None else _rounded(part.joint)) for part in parts]
    joints = tuple(part.joint for part in parts if part.joint is not None)
    joints = tuple(_unique_names(joints))
    geometries = _geometries(parts, density, findings)
    bounds = np.concatenate([surface.vertices for part in parts for surface in part.surfaces])
    size = np.ptp(bounds, axis=0)
    diagonal = float(np.linalg.norm(size))
    opened = tuple(
        joint
        for joint, part in zip(joints, parts[1:], strict=True)
        if np.linalg.norm(np.ptp(np.concatenate([s.vertices for s in part.surfaces]), axis=0)) > KNOB_SHARE * diagonal
    )[:MOST_STATES_OF]
    sections = Sections(MOST_SECTIONS_CLOSED, model_id)
    closed = _state(parts, joints, {joint.name: 0.0 for joint in joints}, sections)
    affordable = max(0, (MOST_SECTIONS // max(sections.taken, 1) - 2) // 2)
    if affordable < len(opened):
        findings.append(f"states of {affordable} of {len(opened)} joints: it has too many collision pieces for more")
        opened = opened[:affordable]
    sections = Sections(2 * MOST_SECTIONS, model_id)  # what opens may cross more than what is closed
    states = (closed, *(_state(parts, joints, values, sections) for values in joint_values(joints, opened)[1:]))
    width = float(min(size[0], size[1]))
    model = CadModel(
        id=model_id,
        class_name=class_name,
        articulated=bool(joints),
        mass=round(sum(part.properties.mass for part in geometries), 6),
        states=states,
        joints=joints,
        movable=movable,
        contains=bool(contains),
        grasp_width=round(width, 4) if movable and width <= WIDEST_GRASP else None,
        parts=tuple(part.name for part in parts),
        recipe=recipe,
    )
    uses = affordances(model, {part.name: part.pieces for part in parts})
    if contains is None:
        model = model.model_copy(update={"contains": class_name in CONTAINERS or bool(uses.contains)})
    return Assembled(model, tuple(geometries), uses, tuple(findings), sum(len(part.pieces) for part in parts))


def _rounded(joint: Joint) -> Joint:
    def short(values: tuple[float, float, float] | None, digits: int) -> tuple[float, float, float] | None:
        return None if values is None else as_vector(np.round(values, digits) + 0.0)

    axis = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
    return joint.model_copy(
        update={
            "origin": short(joint.origin, 7),
            "axis": as_vector(np.round(axis, 9) + 0.0),
            "lower": round(joint.lower, 7) + 0.0,
            "upper": round(joint.upper, 7) + 0.0,
            "handle": short(joint.handle, 6),
            "handle_axis": short(joint.handle_axis, 6),
        }
    )


def _unique_names(joints: Sequence[Joint]) -> list[Joint]:
    by_name: dict[str, Joint] = {}
    for joint in joints:
        name, number = joint.name, 1
        while name in by_name:
            number += 1
            name = f"{joint.name}_{number}"
        by_name[name] = joint.model_copy(update={"name": name})
    return list(by_name.values())


def _geometries(parts: Sequence[Part], density: float, findings: list[str]) -> list[PartGeometry]:
    volumes = [sum(volume(piece) for piece in part.pieces) for part in parts]
    stated_masses = [part.mass for part in parts]
    if any(mass is not None for mass in stated_masses):
        stated_mass = sum(mass for mass in stated_masses if mass is not None)
        covered = sum(v for v, mass in zip(volumes, stated_masses, strict=True) if mass is not None)
        if not 0 < stated_mass < HEAVIEST_MODEL:
            raise BadInput(f"mass of {stated_mass:.3g} kg")
        mean = stated_mass / covered
        masses = [mean * v if mass is None else mass for v, mass in zip(volumes, stated_masses, strict=True)]
    else:
        density = min(density, LARGEST_MASS / sum(volumes))
        masses = [density * v for v in volumes]
        findings.append(f"no mass: {sum(masses):.3g} kg at {density:g} kg/m3")
    mean_density = sum(masses) / sum(volumes)
    if sum(masses) > LARGEST_MASS or not LIGHTEST <= mean_density <= HEAVIEST:
        findings.append(f"mass of {sum(masses):.3g} kg ({mean_density:.2g} kg/m3) is unusual")
    result = []
    for part, mass, part_volume in zip(parts, masses, volumes, strict=True):
        origin = np.zeros(3) if part.joint is None else np.asarray(part.joint.origin)
        pieces = [piece.shifted(*(-origin)) for piece in part.pieces]
        properties = mass_properties(pieces, [mass / part_volume] * len(pieces))
        patches, colors = painted(part.surfaces, origin)
        plain = [colors[0]] * len(pieces)
        result.append(PartGeometry(part.name, pieces, plain, properties, patches, colors))
    return result


def _state(
    geometry: Sequence[Part], joints: Sequence[Joint], values: dict[str, float], sections: Sections
) -> ModelState:
    solids, points = list(geometry[0].pieces), [surface.vertices for surface in geometry[0].surfaces]
    for part, joint in zip(geometry[1:], joints, strict=True):
        moved = motion(joint, values[joint.name])
        solids += [piece.moved(moved) for piece in part.pieces]
        points += [apply(moved, surface.vertices) for surface in part.surfaces]
    every = np.concatenate(points)
    return ModelState(
        joints=values,
        box_minimum=as_vector(np.round(every.min(axis=0), 9) + 0.0),
        box_maximum=as_vector(np.round(every.max(axis=0), 9) + 0.0),
        planes=surface_planes(solids, sections=sections),
    )
