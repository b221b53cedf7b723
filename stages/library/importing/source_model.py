"""What every format is read into: links with painted triangles, joints between them, and what the file declares."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scenewright.stages.kit.geometry.file_axes import Direction
from scenewright.stages.kit.geometry.solids import Solid
from scenewright.stages.kit.geometry.transforms import apply

JointKind = Literal["fixed", "floating", "revolute", "continuous", "prismatic"]


@dataclass(frozen=True)
class Surface:
    """Triangles with a colour each."""

    vertices: np.ndarray
    """(V, 3) in the frame and unit of its owner."""
    faces: np.ndarray
    """(F, 3) int."""
    colors: np.ndarray
    """(F, 3) uint8."""
    name: str = ""
    """What the file calls it; may say `handle`."""
    solid: Solid | None = None
    """The same as a convex solid, for boxes, cylinders and spheres."""
    mesh_origin: np.ndarray | None = None
    """(3,) where the origin of its mesh file lies, None for what a description writes itself."""
    mesh_unit: float = 1.0
    """Metres per unit of the mesh file that were applied."""

    def moved(self, target_from_source: np.ndarray) -> Surface:
        """Return the surface under a (4, 4) transform, which may scale and mirror."""
        mirrored = bool(np.linalg.det(target_from_source[:3, :3]) < 0)
        faces = self.faces[:, ::-1] if mirrored else self.faces
        vertices = apply(target_from_source, self.vertices)
        solid = self.solid
        if solid is not None:
            turned = solid.faces[:, ::-1] if mirrored else solid.faces
            solid = Solid(apply(target_from_source, solid.vertices), turned, solid.curved)
        origin = None if self.mesh_origin is None else apply(target_from_source, self.mesh_origin[None])[0]
        return replace(self, vertices=vertices, faces=faces, solid=solid, mesh_origin=origin)

    def in_unit(self, unit: float) -> Surface:
        """Return the surface as it is when its mesh file is in units of `unit` metres; other shapes stay."""
        if self.mesh_origin is None:
            return self
        vertices = self.mesh_origin + unit / self.mesh_unit * (self.vertices - self.mesh_origin)
        return replace(self, vertices=vertices, mesh_unit=unit)


@dataclass(frozen=True)
class SourceLink:
    """A rigid body in its own frame."""

    name: str
    visual: tuple[Surface, ...] = ()
    collision: tuple[Surface, ...] = ()
    mass: float | None = None
    """[kg], when the file says it."""
    marks: tuple[tuple[str, np.ndarray], ...] = ()
    """Named points (3,), such as MJCF sites."""
    role: str = ""
    """What the data set calls the part (`drawer`, `handle`)."""


@dataclass(frozen=True)
class SourceJoint:
    """A joint: parent_from_child at value 0; `anchor` and `axis` (3,) in the child's frame; limits in rad or units."""

    name: str
    kind: JointKind
    parent: str
    child: str
    parent_from_child: np.ndarray
    anchor: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    lower: float = 0.0
    upper: float = 0.0


@dataclass(frozen=True)
class Declared:
    """A unit, an axis or the like, and where it comes from."""

    value: float | Direction | None
    origin: str
    """`file`, `format` (its specification says so), `assumed`."""


@dataclass(frozen=True)
class SourceModel:
    """One model as its file has it. Lengths in units of `unit` metres."""

    name: str
    source: str
    """Path of the file below the folder."""
    format: str
    links: tuple[SourceLink, ...]
    joints: tuple[SourceJoint, ...] = ()
    unit: Declared = Declared(1.0, "format")
    """Metres per unit."""
    up: Declared = Declared((0.0, 0.0, 1.0), "format")
    front: Declared = Declared(None, "assumed")
    """Where it looks, None when nothing says so."""
    words: tuple[str, ...] = ()
    """Names that may tell the class, the best first."""
    mesh_unit: float | None = None
    """Metres per unit of the mesh files, where they declare one and the description has applied it."""
    contains: bool | None = None
    """Whether the data set says that things can be put inside."""
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeshContent:
    """Surfaces of one mesh file, in the file's frame and unit."""

    surfaces: tuple[Surface, ...]
    unit: Declared
    up: Declared
    findings: tuple[str, ...] = ()

    @property
    def triangles(self) -> int:
        """How many there are."""
        return sum(len(surface.faces) for surface in self.surfaces)


def held_fast(joint: str, kind: str) -> str:
    """Return the finding on a joint of a type that no model here has."""
    return f"joint {joint!r:.40} is of type {kind!r:.20}: held fast"


def coupled(joint: str, driver: str) -> str:
    """Return the finding on a joint that another one drives."""
    return f"joint {joint!r:.40} follows joint {driver!r:.40} (mimic): here both move freely"


PLAIN_COLOR = (178, 178, 178)
"""Colour of what has none (sRGB, of 255)."""


def painted_faces(count: int, color: tuple[float, float, float] | None) -> np.ndarray:
    """Return (count, 3) uint8 of one colour given in 0..1, or the plain one."""
    values = PLAIN_COLOR if color is None else tuple(round(255 * min(max(c, 0.0), 1.0)) for c in color)
    return np.tile(np.array(values, dtype=np.uint8), (count, 1))


def solid_surface(solid: Solid, color: tuple[float, float, float] | None, name: str = "") -> Surface:
    """Return a convex solid as a painted surface."""
    return Surface(solid.vertices, solid.faces, painted_faces(len(solid.faces), color), name, solid)
