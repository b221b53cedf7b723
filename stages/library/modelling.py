"""From a design to the record of a CAD model: states with boxes and planes, masses, parts in their own frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cad_library import CadModel, ModelState
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.formats.model_writer import PartGeometry
from scenewright.stages.kit.geometry.solids import Solid
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.library.design import Design, mass_of
from scenewright.stages.library.joint_kinds import joint_kind
from scenewright.stages.library.surfaces import surface_planes
from scipy.spatial.transform import Rotation

BODY = "body"
TURNED = ("knob", "lever")
"""Kinds of joints that change nothing of the shape: no state of their own."""


def describe(design: Design, model_id: str, movable: bool) -> CadModel:
    """Return the library's record of a centred design."""
    joints = tuple(link.joint for link in design.moving)
    vertices = np.concatenate([piece.solid.vertices for piece in design.pieces()])
    shaping = tuple(
        link.joint
        for link in design.moving
        if joint_kind(link.joint, np.concatenate([piece.solid.vertices for piece in link.pieces]), vertices)
        not in TURNED
    )
    behind = {link.joint.name: link.behind for link in design.moving if link.behind is not None}
    return CadModel(
        id=model_id,
        class_name=design.class_name,
        articulated=bool(joints),
        mass=round(sum(part.properties.mass for part in part_geometries(design)), 6),
        states=tuple(_state(design, values) for values in joint_values(joints, shaping, behind)),
        joints=joints,
        movable=movable,
        contains=design.contains,
        grasp_width=design.grasp_width if movable else None,
        parts=(BODY, *(joint.part for joint in joints)),
        recipe=design.recipe,
    )


def closed_solids(design: Design) -> dict[str, list[Solid]]:
    """Return part -> its pieces in the model frame at joint value 0, of a centred design."""
    solids = {BODY: [piece.solid for piece in design.body]}
    return solids | {link.joint.part: [piece.solid for piece in link.pieces] for link in design.moving}


def part_geometries(design: Design) -> list[PartGeometry]:
    """Return the body and the moving links, each in its part frame (origin at its joint)."""
    geometries = []
    for name, pieces, origin in [
        (BODY, design.body, np.zeros(3)),
        *((link.joint.part, link.pieces, np.asarray(link.joint.origin)) for link in design.moving),
    ]:
        local = [piece.solid.shifted(*(-origin)) for piece in pieces]
        properties_of_all = mass_of(pieces)
        properties = type(properties_of_all)(
            properties_of_all.mass, properties_of_all.center - origin, properties_of_all.inertia
        )
        geometries.append(PartGeometry(name, local, [piece.paint.color for piece in pieces], properties))
    return geometries


def joint_values(
    joints: tuple[Joint, ...], opened: tuple[Joint, ...] | None = None, behind: Mapping[str, str] | None = None
) -> list[dict[str, float]]:
    """Return closed; every joint alone half and fully open; all fully open.

    With `opened` only those joints open, the others stay closed (the knobs of an oven change none of its shape).
    `behind`: joint name -> name of the joint that is fully open whenever that one opens.
    """
    closed = {joint.name: 0.0 for joint in joints}
    ranges = {joint.name: joint.upper for joint in joints}
    values = [closed]
    joints = joints if opened is None else opened
    for joint in joints:
        first = (behind or {}).get(joint.name)
        before = closed if first is None else {**closed, first: ranges[first]}
        values += [{**before, joint.name: round(share * joint.upper, 6)} for share in (0.5, 1.0)]
    if len(joints) > 1:
        values.append({**closed, **{joint.name: joint.upper for joint in joints}})
    return values


def _state(design: Design, values: dict[str, float]) -> ModelState:
    solids: list[Solid] = [piece.solid for piece in design.body]
    for link in design.moving:
        moved = motion(link.joint, values[link.joint.name])
        solids += [piece.solid.moved(moved) for piece in link.pieces]
    points = np.concatenate([solid.vertices for solid in solids])
    return ModelState(
        joints=values,
        box_minimum=as_vector(np.round(points.min(axis=0), 9) + 0.0),
        box_maximum=as_vector(np.round(points.max(axis=0), 9) + 0.0),
        planes=surface_planes(solids),
    )


def motion(joint: Joint, value: float) -> np.ndarray:
    """Return the (4, 4) rigid motion in the model frame that the joint value makes of the closed link."""
    axis, origin = np.asarray(joint.axis), np.asarray(joint.origin)
    if joint.type == "prismatic":
        return transform_from(np.eye(3), value * axis)
    rotation = Rotation.from_rotvec(value * axis).as_matrix()
    return transform_from(rotation, origin - rotation @ origin)
