"""Kind `tableware_detections`: what vision says of a table, with confidences and what was not handled."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Transform, Vector3
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.tableware_dishes import TablewareDishes

DetectedKind = Literal["cup", "bowl", "plate", "fork", "spoon"]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Length = Annotated[float, Field(ge=0.0, le=2.0)]
MOST_DETECTIONS = 500
"""Most items or outlines; a bound, by eye."""


class DetectedSize(Model):
    """Measures of a dish whose size was estimated [m]."""

    height: Length
    rim_radius: Length
    foot_radius: Length
    wall: Length


class TablewareDetection(Model):
    """One item that was seen, or that the height of a stack says must be there. World frame [m, rad]."""

    kind: DetectedKind | None
    """None for something that is no tableware of known size."""
    position: Vector3
    """Foot centre of a dish, middle of the underside of a utensil."""
    yaw: float = 0.0
    """Of a utensil, from the handle's end to the head, -pi to pi."""
    lip: float
    """Height of the upper edge above the table."""
    on: int | None = Field(default=None, ge=0)
    """Index of the item that carries it, always a lower one; None for the table."""
    hidden: bool = False
    """Inferred from the height of the stack alone."""
    grasp: Vector3 | None = None
    """Of a utensil: the highest point along its axis."""
    extent: float = Field(default=0.0, ge=0.0)
    """Of an unknown thing: radius of the circle around it."""
    size: DetectedSize | None = None
    """Where it was estimated; else the size is that of the kind."""
    confidence: Share
    """Chance that the kind and the place (within 20 mm) are right; 0 for unknown things."""
    unsure: tuple[str, ...] = ()
    """Reasons for doubt."""


class TablewareOutline(Model):
    """A round thing in a photograph without depth: a box of pixels (left, top, right, bottom)."""

    kind: Literal["cup", "bowl", "plate"] | None
    """By its width in the picture, where the picture's scale was given."""
    box: tuple[float, float, float, float]
    confidence: Share
    unsure: tuple[str, ...] = ()


class TablePlane(Model):
    """n.p + d = 0 in the camera's frame, the unit normal towards the camera [m]."""

    normal: Vector3
    offset: float


class TablewareDetectionsFile(Model):
    """detections.json."""

    statement: str
    """One line: what is there, what is in doubt, what was not handled."""
    notes: tuple[str, ...] = ()
    """What was not handled, one line each."""
    heights_known: bool = True
    """False for a photograph without depth: it has outlines and no items, and nothing can be planned from it."""
    items: tuple[TablewareDetection, ...] = Field(default=(), max_length=MOST_DETECTIONS)
    outlines: tuple[TablewareOutline, ...] = Field(default=(), max_length=MOST_DETECTIONS)
    camera: Camera | None = None
    world_from_camera: Transform | None = None
    """The world's origin is the middle of the workspace, x along its longer side, z up."""
    table: TablePlane | None = None
    workspace: tuple[float, float] | None = None
    """Its sides along x and y [m]."""
    rectified: bool = False
    """The view was not from straight above: it was resampled over the table's plane."""
    sizes: Literal["known", "estimated"] = "known"
    dishes: TablewareDishes | None = None
    """The user's sizes and gripper; None: the standard ones."""

    @model_validator(mode="after")
    def _carriers_come_first(self) -> TablewareDetectionsFile:
        for index, item in enumerate(self.items):
            if item.on is not None and item.on >= index:
                raise ValueError(f"item {index} stands on item {item.on}, which must come before it")
            if item.on is not None and self.items[item.on].kind is None:
                raise ValueError(f"item {index} stands on item {item.on}, whose kind is unknown")
        if not self.heights_known and self.items:
            raise ValueError("where heights are unknown there are outlines, and no items")
        return self


class TablewareDetections(Artifact):
    """`detections.json`, `overlay.png` (the image with what was found and how sure that is), and `above.png` (the view
    from straight above, where the image was rectified)."""

    kind: ClassVar[str] = "tableware_detections"
    description: ClassVar[str] = "tableware that was seen on a table, with confidences"
    info = Document(TablewareDetectionsFile, "detections.json")
