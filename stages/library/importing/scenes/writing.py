"""A scene that others wrote as a folder of ours: scene.json, a URDF a body, and the whole for MuJoCo."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import InteractiveSceneFile, SceneBody
from scenewright.stages.kit.formats.mjcf_file import write_mjcf
from scenewright.stages.kit.formats.model_writer import write_obj
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.formats.urdf_file import Link, Urdf, UrdfJoint, write_urdf
from scenewright.stages.kit.geometry.boxes import box_from_bounds, points_in_box
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing.scenes.bodies import OthersBody
from scenewright.stages.library.importing.scenes.shapes import Hulls

SceneFormat = Literal["URDF", "MJCF", "SDF"]
WORLD = "world"


@dataclass(frozen=True)
class OthersScene:
    """A scene as its file has it."""

    path: Path
    format: SceneFormat
    bodies: tuple[OthersBody, ...]
    hulls: Hulls
    joint_values: dict[str, float] = field(default_factory=dict)
    """Joint -> value [rad, m] at the start; absent: 0, or the limit nearest to it."""
    grounds: frozenset[str] = frozenset()
    """Bodies with a plane."""
    numbers: dict[str, int] = field(default_factory=dict)
    """Free body -> its number in MuJoCo, of an MJCF."""
    model: Any = None
    """What MuJoCo made of an MJCF."""
    findings: tuple[str, ...] = ()
    """What was left out, or taken as something else."""


class PlainNames:
    """Names that URDF allows, each given once."""

    def __init__(self) -> None:
        self._given = {WORLD}

    def of(self, name: str) -> str:
        """Return the name with other characters as `_`, and a number after it where it was given before."""
        plain = re.sub(r"[^A-Za-z0-9_.\-]+", "_", name)[:150].lstrip(".-") or "body"
        unique, number = plain, 1
        while unique in self._given:
            number += 1
            unique = f"{plain}_{number}"
        self._given.add(unique)
        return unique


def write_scene(folder: Path, scene: OthersScene) -> None:
    """Write scene.json, static.urdf, a URDF a body, its hulls, and scene.mjcf.xml into an empty folder.

    Raises BadInput, which names the scene's own file, for a body that no engine takes.
    """
    values = {
        joint.name: scene.joint_values.get(joint.name, _closed(joint)) for body in scene.bodies for joint in body.joints
    }
    (folder / "meshes").mkdir()
    for file, solid in scene.hulls.solids.items():
        write_obj(folder / file, solid.vertices, solid.faces)
    write_urdf(folder / "static.urdf", Urdf(WORLD, (Link(WORLD),)))
    for body in scene.bodies:
        write_urdf(folder / f"{body.name}.urdf", Urdf(body.name, _whole(body), body.joints))
        if problems := check_urdf(folder / f"{body.name}.urdf"):
            raise BadInput(f"{scene.path}: body {body.name}: {problems[0]}", hint="mend it")
    records = _with_contents([_record(body, scene, values) for body in scene.bodies])
    InteractiveSceneFile(static_file="static.urdf", bodies=records).write(folder / "scene.json")
    write_mjcf(folder / "scene.mjcf.xml", _tree(scene.bodies), values)


def _closed(joint: UrdfJoint) -> float:
    """Return 0, or the limit nearest to it."""
    return 0.0 if joint.type == "continuous" else min(max(0.0, joint.lower), joint.upper)


def _whole(body: OthersBody) -> tuple[Link, ...]:
    """Return the links; the mass of the first of what stands fast does nothing, and loaders want one."""
    first = body.links[0]
    if body.free:
        return body.links
    return replace(first, inertial=MassProperties(1.0, np.zeros(3), np.eye(3))), *body.links[1:]


def _record(body: OthersBody, scene: OthersScene, values: dict[str, float]) -> SceneBody:
    corners = [scene.hulls.bounds(shape) for shape in body.links[0].collisions]
    placed = apply(body.world_from_body, np.concatenate(corners or [np.zeros((1, 3))]))
    return SceneBody(
        name=body.name,
        class_name="floor" if body.name in scene.grounds else "object",
        movable=body.free,
        file=f"{body.name}.urdf",
        world_from_body=as_transform(body.world_from_body),
        joint_values={joint.name: values[joint.name] for joint in body.joints},
        box=box_from_bounds(placed.min(axis=0), placed.max(axis=0)),
        mass=sum(link.inertial.mass for link in body.links if link.inertial is not None),
        world_from_reconstructed=None,
    )


def _with_contents(records: Sequence[SceneBody]) -> tuple[SceneBody, ...]:
    """Return the bodies, free ones whose middle lies in the box of one with doors or drawers as what that contains: it
    rides along when these move. No file says so."""
    holders = sorted((body for body in records if body.joint_values), key=lambda body: float(np.prod(body.box.size)))

    def holder(body: SceneBody) -> SceneBody | None:
        middle = np.array([body.box.center])
        return next((h for h in holders if h is not body and points_in_box(h.box, middle).all()), None)

    held = {body.name: found.name for body in records if body.movable and (found := holder(body)) is not None}
    return tuple(
        body.model_copy(update={"parent": held[body.name], "relation": "contains"}) if body.name in held else body
        for body in records
    )


def _tree(bodies: Iterable[OthersBody]) -> Urdf:
    """Return all bodies below the world."""
    links, joints = [Link(WORLD)], []
    for body in bodies:
        kind = "floating" if body.free else "fixed"
        joints.append(UrdfJoint(f"{body.name}__in_the_world", kind, WORLD, body.name, body.world_from_body))
        links += _whole(body)
        joints += body.joints
    return Urdf("scene", tuple(links), tuple(joints))
