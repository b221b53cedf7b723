"""What is wrong with a URDF that loads fine: the checks that parsers leave out."""

from __future__ import annotations

import functools
import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content
from scenewright.stages.kit.formats.known_elements import unknown_elements
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.urdf_file import (
    COUNTED,
    JOINT_TYPES,
    KNOWN_URDF,
    MAXIMUM_BYTES,
    Link,
    Primitive,
    Shape,
    Urdf,
    UrdfJoint,
    parse_urdf,
)
from scenewright.stages.kit.formats.xml_files import parse_xml

NAME = re.compile(r"[A-Za-z0-9_.\-]+")
READ_MESHES = (".obj", ".stl", ".ply", ".glb")
LARGEST_REACH = 1e5
"""Metres, of a mesh's vertices from its origin: engines compute in float32."""
SMALLEST_EXTENT = 1e-9
"""Smallest extent of a shape [m]."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: a kind for programs, the element, a sentence for people."""

    kind: str
    element: str
    message: str

    def __str__(self) -> str:
        return f"{self.element}: {self.message}"


def check_urdf(path: Path, root: Path | None = None) -> list[Problem]:
    """Return what is wrong with a URDF; an empty list when nothing is.

    Mesh files must lie inside `root` (the folder of the URDF when None).
    Kinds: `unreadable`, `name`, `duplicate`, `dangling`, `cycle`, `roots`, `not_finite`, `axis`, `limits`,
    `joint_type`, `mimic`, `mass`, `inertia`, `no_inertia`, `friction`, `mesh_missing`, `mesh_outside`,
    `mesh_unreadable`, `geometry`.
    """
    path = Path(path)
    try:
        urdf = parse_urdf(path)
    except BadInput as error:
        return [Problem("unreadable", path.name, error.message.removeprefix(f"{path}: "))]
    problems = _check_names(urdf) + _check_tree(urdf) + _check_mimics(urdf)
    moving = {joint.child for joint in urdf.joints if joint.type != "fixed"}
    if not urdf.joints:
        moving |= {link.name for link in urdf.links if link.visuals or link.collisions}
    for link in urdf.links:
        problems += _check_inertia(link, must_have=link.name in moving)
        if link.friction is not None and not 0 <= link.friction < np.inf:
            problems.append(Problem("friction", f"link {link.name!r}", "lateral friction is negative or not finite"))
        for shape in (*link.visuals, *link.collisions):
            problems += _check_shape(link.name, shape, path.parent, root or path.parent)
        problems += [_primitive_fault(link.name, p) for p in link.primitives if not _has_size(p)]
    for joint in urdf.joints:
        problems += _check_joint(joint)
    return problems


def advice(path: Path) -> list[Problem]:
    """Return what is sound and still seldom meant: things that move, can be seen, and touch nothing (`no_collision`),
    shapes that readers differ on (`capsule`), elements that `library add` does not read (`unknown`).

    Raises BadInput for a file that cannot be read.
    """
    urdf = parse_urdf(Path(path))
    moving = {joint.child for joint in urdf.joints if joint.type != "fixed"}
    untouched = [
        Problem("no_collision", f"link {link.name!r}", "moves and has a shape to see, and none to touch")
        for link in urdf.links
        if link.name in moving and link.visuals and not link.collisions
    ]
    capsules = [
        Problem("capsule", f"link {link.name!r}", "a capsule is newer than many readers of URDF, which leave it out")
        for link in urdf.links
        if any(primitive.kind == "capsule" for primitive in link.primitives)
    ]
    robot = parse_xml(file_content(Path(path), MAXIMUM_BYTES, hint="give a URDF"), str(path))
    unknown = [Problem("unknown", "robot", line) for line in unknown_elements([robot], KNOWN_URDF, COUNTED)]
    return untouched + capsules + unknown


def require_sound(path: Path, root: Path | None = None) -> None:
    """Raise BadInput with the first problem of a URDF, and how many there are."""
    problems = check_urdf(path, root)
    if problems:
        and_more = f", and {len(problems) - 1} more" if len(problems) > 1 else ""
        raise BadInput(f"{path}: {problems[0]}{and_more}", hint="the model or scene behind it is broken")


def _check_names(urdf: Urdf) -> list[Problem]:
    problems = []
    for element, names in (
        ("link", [link.name for link in urdf.links]),
        ("joint", [joint.name for joint in urdf.joints]),
    ):
        problems += [
            Problem("name", f"{element} {n!r}", "name is empty or not ASCII letters, digits, _ . -")
            for n in names
            if not NAME.fullmatch(n)
        ]
        problems += [
            Problem("duplicate", f"{element} {n!r}", f"stands {count} times")
            for n, count in Counter(names).items()
            if count > 1
        ]
    return problems


def _check_tree(urdf: Urdf) -> list[Problem]:
    names = {link.name for link in urdf.links}
    problems = []
    parents: dict[str, str] = {}
    for joint in urdf.joints:
        for role, end in (("parent", joint.parent), ("child", joint.child)):
            if end not in names:
                problems.append(Problem("dangling", f"joint {joint.name!r}", f"{role} link {end!r} does not exist"))
        if joint.child in parents:
            problems.append(Problem("cycle", f"link {joint.child!r}", "has more than one parent joint"))
        parents[joint.child] = joint.parent
    problems += [Problem("cycle", f"link {name!r}", "is its own ancestor") for name in _in_circles(parents)]
    if not names:
        problems.append(Problem("roots", "robot", "has no links"))
    elif len(urdf.roots()) != 1:
        problems.append(
            Problem("roots", "robot", f"has {len(urdf.roots())} root links, expected 1: {urdf.roots()[:4]}")
        )
    return problems


def _in_circles(following: dict[str, str]) -> list[str]:
    """Return the keys from which following leads back to themselves, sorted. Every key is visited twice at most."""
    circles: set[str] = set()
    done: set[str] = set()
    for start in following:
        path: dict[str, None] = {}
        name = start
        while name in following and name not in done and name not in path:
            path[name] = None
            name = following[name]
        if name in path:
            walked = list(path)
            circles.update(walked[walked.index(name) :])
        done.update(path)
    return sorted(circles)


def _check_mimics(urdf: Urdf) -> list[Problem]:
    driven = {joint.name: joint.mimics for joint in urdf.joints if joint.mimics is not None}
    names = {joint.name for joint in urdf.joints}
    problems = [
        Problem("mimic", f"joint {name!r}", f"mimics joint {driver!r}, which does not exist")
        for name, driver in driven.items()
        if driver not in names
    ]
    return problems + [Problem("mimic", f"joint {name!r}", "mimics itself in a circle") for name in _in_circles(driven)]


def _check_inertia(link: Link, must_have: bool) -> list[Problem]:
    element = f"link {link.name!r}"
    if link.inertial is None:
        return (
            [Problem("no_inertia", element, "moves but has no inertial (engines then assume 1 kg)")]
            if must_have
            else []
        )
    mass, tensor = link.inertial.mass, link.inertial.inertia
    if not (np.isfinite(mass) and np.isfinite(tensor).all() and np.isfinite(link.inertial.center).all()):
        return [Problem("not_finite", element, "inertial holds NaN or infinity")]
    problems = []
    if mass <= 0:
        problems.append(Problem("mass", element, f"mass is {mass:g} kg"))
    if not np.isfinite(scale := float(np.abs(tensor).max())) or scale > 1e12:
        return [*problems, Problem("inertia", element, f"inertia of {scale:g} kg m^2")]
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] <= 0:
        problems.append(
            Problem("inertia", element, f"inertia is not positive definite, smallest moment {moments[0]:g} kg m^2")
        )
    elif moments[0] + moments[1] < moments[2] * (1 - 1e-6):
        problems.append(
            Problem(
                "inertia",
                element,
                f"moments {moments[0]:g}, {moments[1]:g}, {moments[2]:g} break the triangle inequality",
            )
        )
    return problems


def _has_size(primitive: Primitive) -> bool:
    return bool(primitive.sizes) and bool(np.isfinite(primitive.sizes).all()) and min(primitive.sizes) > 0


def _primitive_fault(link: str, primitive: Primitive) -> Problem:
    what = (
        f"{primitive.kind} of size {primitive.sizes}"
        if primitive.sizes
        else f"URDF has no shape <{primitive.kind:.40}>"
    )
    return Problem("geometry", f"link {link!r}", what)


def _check_shape(link: str, shape: Shape, folder: Path, root: Path) -> list[Problem]:
    element = f"link {link!r}"
    if not np.isfinite(shape.link_from_shape).all() or not np.isfinite(shape.scale):
        return [Problem("not_finite", element, "geometry origin or scale holds NaN or infinity")]
    if shape.box_size is not None:
        if not (np.isfinite(shape.box_size).all() and min(shape.box_size) > 0):
            return [Problem("geometry", element, f"box size {shape.box_size}")]
        return []
    name = shape.mesh or ""
    if shape.scale <= 0:
        return [Problem("geometry", element, f"mesh {name!r} has scale {shape.scale:g}")]
    try:
        root = root.resolve()
        target = (folder / name).resolve()
        exists = target.is_file()
    except (OSError, ValueError, RuntimeError) as error:  # too long, with a zero byte, links in a circle
        return [Problem("mesh_outside", element, f"mesh {name!r:.80}: {getattr(error, 'strerror', None) or error}")]
    if "://" in name or PurePosixPath(name).is_absolute() or not target.is_relative_to(root) or target == root:
        return [Problem("mesh_outside", element, _outside(name, folder, root))]
    if not exists:
        return [Problem("mesh_missing", element, f"mesh {name!r} does not exist")]
    reason = _mesh_fault(target)
    return [Problem("mesh_unreadable", element, f"mesh {name!r}: {reason}")] if reason else []


def _outside(name: str, folder: Path, root: Path) -> str:
    """Say that a mesh is not named by a path inside the folder, and which path it has there, sought by its end."""
    parts = [part for part in PurePosixPath(name.partition("://")[2] or name).parts if part not in ("/", "..")]
    places = [place.resolve() for place in (folder, *folder.resolve().parents) if place.resolve().is_relative_to(root)]
    for start in range(len(parts)):
        for place in places:
            found = place.joinpath(*parts[start:])
            if found.is_file() and found.resolve().is_relative_to(root):
                path = os.path.relpath(found, folder.resolve())
                return f"mesh {name!r} is not a path inside the folder of the model; write {path!r}"
    return f"mesh {name!r} is not a path inside the folder of the model, and not found there by its end"


def _mesh_fault(path: Path) -> str:
    """Say why physics engines, which crash on it or load nothing, must not be given this mesh file; empty: they may."""
    if path.suffix.lower() not in READ_MESHES:
        return ""
    status = path.stat()
    return _mesh_fault_of(str(path), status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=20_000)
def _mesh_fault_of(path: str, changed_ns: int, size: int) -> str:
    try:
        mesh = read_mesh(Path(path))
    except BadInput as error:
        return error.message.removeprefix(f"{path}: ")
    reach = float(np.abs(mesh.vertices).max())
    if reach > LARGEST_REACH:
        return f"reaches {reach:.3g} m from its origin"
    return "is a single point" if float(np.ptp(mesh.vertices, axis=0).max()) < SMALLEST_EXTENT else ""


def _check_joint(joint: UrdfJoint) -> list[Problem]:
    element = f"joint {joint.name!r}"
    if joint.type not in JOINT_TYPES:
        return [Problem("joint_type", element, f"type {joint.type!r} is not one of {', '.join(JOINT_TYPES)}")]
    if not np.isfinite(joint.parent_from_child).all():
        return [Problem("not_finite", element, "origin holds NaN or infinity")]
    if joint.type in ("fixed", "floating"):
        return []
    values = (*joint.axis, joint.lower, joint.upper, joint.effort, joint.velocity)
    if not np.isfinite(values).all():
        return [Problem("not_finite", element, "axis or limit holds NaN or infinity")]
    problems = []
    if np.linalg.norm(joint.axis) < 1e-6:
        problems.append(Problem("axis", element, "axis has no length"))
    if joint.type != "continuous":
        if joint.lower > joint.upper:
            problems.append(Problem("limits", element, f"lower {joint.lower:g} > upper {joint.upper:g}"))
        if joint.effort <= 0 or joint.velocity <= 0:
            problems.append(
                Problem("limits", element, f"effort {joint.effort:g} or velocity {joint.velocity:g} is not positive")
            )
    return problems
