"""What can be done with the models of a CAD library: rooms, surfaces and grasps in the picture, a table of all."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.cad_library import Affordances, CadLibrary, CadModel, InnerVolume
from scenewright.stages.kit.formats.cad_models import part_transforms
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.viewing.canvas import Canvas

ROOM, SURFACE, GRASP = (90, 170, 220), (110, 190, 100), (220, 120, 40)
"""Colours of inner rooms, carrying surfaces and grasps (sRGB, of 255)."""
HEADER = "| model | carried | opens | knobs, levers | contains [l] | carries [m²] | grasps |"


def draw_affordances(entity: str, model: CadModel, uses: Affordances, canvas: Canvas) -> None:
    """Draw inner volumes as boxes, support surfaces as outlines, grasp places as points, each on the part it moves
    with."""
    closed = {part: frame[:3, 3] for part, frame in part_transforms(model, {}).items()}
    for part in model.parts:
        origin = closed[part]
        rooms = [room for room in uses.contains if room.part == part]
        boxes = [box_from_bounds(np.array(r.box_minimum) - origin, np.array(r.box_maximum) - origin) for r in rooms]
        labels = ["room" for _ in rooms]
        canvas.boxes(f"{entity}/{part}/rooms", boxes, labels, [ROOM] * len(rooms), show_labels=False)
        planes = [model.states[0].planes[surface.plane] for surface in uses.carries if surface.part == part]
        outlines = [np.array([*plane.corners, plane.corners[0]]) - origin for plane in planes if plane.corners]
        if outlines:
            canvas.line(f"{entity}/{part}/carries", outlines, [SURFACE] * len(outlines))
        points = [np.array(grasp.point) - origin for grasp in uses.grasps if grasp.part == part]
        if points:
            colors = np.tile(np.array(GRASP, dtype=np.uint8), (len(points), 1))
            canvas.points(f"{entity}/{part}/grasps", np.array(points), colors, radius=0.012)


def affordance_table(library: CadLibrary) -> str:
    """Return the affordances of all models as a Markdown table; empty when the library has none."""
    rows = [_row(uses) for uses in library.info.affordances]
    return "\n".join([HEADER, "|" + "---|" * (HEADER.count("|") - 1), *rows]) if rows else ""


def _row(uses: Affordances) -> str:
    turned = [use.joint for use in uses.joints if use.kind in ("knob", "lever")]
    kinds = {use.joint: use.kind for use in uses.joints}
    opens = ", ".join(f"{name} ({kinds[name]})" for name in uses.openable)
    rooms = ", ".join(f"{room.part} {_litres(room):.3g}" for room in uses.contains)
    area = sum(surface.area for surface in uses.carries if not surface.inside)
    carried = "yes" if uses.movable else ""
    return (
        f"| {uses.model} | {carried} | {opens} | {len(turned) or ''} | {rooms} | {f'{area:.3g}' if area else ''} "
        f"| {len(uses.grasps) or ''} |"
    )


def _litres(room: InnerVolume) -> float:
    return 1000.0 * float(np.prod(np.array(room.box_maximum) - np.array(room.box_minimum)))
