"""Small records that several kinds share: cameras, boxes, planes, joints."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.schemas.base import Model, QuaternionXYZW, Vector3


class Camera(Model):
    """A pinhole camera without distortion. Pixels; pixel centres at integer coordinates (OpenCV)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


class Box(Model):
    """An oriented box: world_from_box has `center` and `orientation`; `size` is the full edge lengths [m].

    Gravity-aligned boxes have an orientation about world z alone.
    """

    center: Vector3
    orientation: QuaternionXYZW = (0.0, 0.0, 0.0, 1.0)
    size: Vector3


class SurfacePlane(Model):
    """A plane n.v + d = 0 in the frame its owner names, with the rectangle of its inliers."""

    normal: Vector3
    offset: float
    area: float
    """Area of the inlier region [m^2]."""
    center: Vector3
    """Centre of the inliers (their mean)."""
    corners: tuple[Vector3, ...] = ()
    """Corners of the inliers' minimum rectangle (0 or 4)."""
    horizontal: bool = False
    """Whether the normal points up within the tolerance a_th (a possible supporting plane)."""
    hidden: bool = False
    """Whether it was registered from a supported object instead of seen."""


class Joint(Model):
    """A joint of an articulated model, in the model frame at scale 1."""

    name: str
    type: Literal["revolute", "prismatic"]
    part: str
    """Name of the moving link."""
    parent: str | None = Field(default=None, exclude_if=lambda name: name is None)
    """Name of the part that it hangs on, a moving one itself (a drawer behind a door); None: the body. Absent from the
    file then."""
    origin: Vector3
    axis: Vector3
    lower: float
    upper: float
    """Limits [rad] or [m]; 0 is closed."""
    handle: Vector3 | None = None
    """Where the moving part is grasped, at joint value 0, model frame."""
    handle_axis: Vector3 | None = None
    """Direction of the handle bar, model frame."""


CARRYING = ("supports", "contains", "carries_on_wall", "hangs_from")
"""Relations that say what carries the target."""
TREE_RELATIONS = (*CARRYING, "unknown")
"""Relations from a parent to its child: every node but the root is the target of one. `unknown` leads from the root to
what nothing seen carries, and claims no support. The others stand beside the tree: `also_supports` (a second carrier),
`leans_on` (what keeps the target from falling over), `proximal` (undirected)."""


class Relation(Model):
    """An edge of a contact graph (node-link `links` entry)."""

    source: str
    """Parent for directed relations; either end for `proximal`."""
    target: str
    relation: Literal[
        "supports", "contains", "carries_on_wall", "hangs_from", "unknown", "also_supports", "leans_on", "proximal"
    ]
    confidence: float
    plane: int | None = None
    """Index into the source's `planes`: the surface that carries, the inner surface that a contained thing stands on,
    the upright plane that it hangs on, the ceiling's plane, the plane it leans on; None where no plane was seen."""
    gap: float | None = None
    """Signed height of the child's bottom over the plane before refinement [m] (equation 2.1); distance to the wall,
    the ceiling or what it leans on; `proximal`: least distance of the two surfaces."""
    overlap: float | None = None
    """Share of the child's footprint over (`hangs_from`: under) the plane (equation 2.2); `carries_on_wall`: of its
    side before the plane; `leans_on`: height of the contact as a share of the child's; `proximal`: shared volume as a
    share of the smaller box."""
    contact: Vector3 | None = Field(default=None, exclude_if=lambda value: value is None)
    """Where the two meet, world frame [m]: the middle of what they share. Absent where nothing says it."""
    inside: float | None = Field(default=None, exclude_if=lambda value: value is None)
    """`contains`: share of the child's box that lies within the parent's."""
    because: str = Field(default="", exclude_if=lambda value: not value)
    """`unknown`: why nothing is said to carry it, as a clause. Absent otherwise."""

    @property
    def says(self) -> str:
        """The relation as a clause: `table_2 supports cup_5`."""
        if self.relation == "unknown":
            return f"nothing is known to carry {self.target}"
        return f"{self.source} {self.relation.replace('_', ' ')} {self.target}"
