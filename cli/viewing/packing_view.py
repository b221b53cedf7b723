"""Packings: basket, boxes where they start and where the last plan puts them, the arm in motion, plans with reasons."""

from __future__ import annotations

import math

import numpy as np
from scenewright.cli.viewing.robot_view import animate_arm, arm_joints, draw_robot, robot_of
from scenewright.schemas.outside import LARGEST_SHOWN, file_content
from scenewright.schemas.packing import (
    BASKET_SLAB,
    BASKET_TOP,
    TABLE_TOP,
    Packing,
    PackingArea,
    PackingBox,
    PackingStep,
)
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.meshes import draw_solid

PICTURES = ("layout", "attempts", "scene")
PERIOD = 0.05
"""Time from one row of the trajectory to the next [s]; it has no times of its own."""
BASKET_COLOR, BLOCK_COLOR = (0.85, 0.75, 0.55), (0.4, 0.4, 0.4)
"""Colours of the basket and of blocks (sRGB, 0 to 1)."""
START_COLOR, PACKED_COLOR = (0.6, 0.7, 0.85), (0.2, 0.55, 0.35)
"""Colours of boxes at the start and packed (sRGB, 0 to 1)."""


def draw_packing(packing: Packing, canvas: Canvas) -> None:
    """Draw the problem, the places of the last plan, the pictures of the step, and every plan as text."""
    instance, result = packing.instance, packing.info
    canvas.document("plans", packing_text(packing))
    for name in PICTURES:
        path = packing.path(f"{name}.png")
        if path.is_file():
            canvas.picture(name, file_content(path, LARGEST_SHOWN))
    basket = area_box(instance.basket, BASKET_TOP - BASKET_SLAB, BASKET_TOP)
    canvas.boxes("basket", [basket], ["basket"], [BASKET_COLOR])
    draw_solid("basket/body", basket, BASKET_COLOR, canvas)
    blocks = instance.obstacles
    if blocks:
        solids = [area_box(block, TABLE_TOP, block.top) for block in blocks]
        canvas.boxes("obstacles", solids, [block.name for block in blocks], [BLOCK_COLOR] * len(blocks))
        for number, solid in enumerate(solids):
            draw_solid(f"obstacles/{number}", solid, BLOCK_COLOR, canvas)
    starts = [standing_box(box, box.x, box.y, box.yaw, TABLE_TOP) for box in instance.boxes]
    names = [box.name for box in instance.boxes]
    canvas.boxes("start", starts, names, [START_COLOR] * len(starts))
    by_name = {box.name: box for box in instance.boxes}
    places = [step for step in result.attempts[-1].steps if placed(step, by_name)] if result.attempts else []
    if places:
        solids = [standing_box(by_name[p.box], p.x or 0.0, p.y or 0.0, p.yaw or 0.0, BASKET_TOP) for p in places]
        canvas.boxes("packed", solids, [packed_step.box for packed_step in places], [PACKED_COLOR] * len(places))
        for number, solid in enumerate(solids):
            draw_solid(f"packed/{number}", solid, PACKED_COLOR, canvas)
    robot = robot_of(packing)
    urdf = draw_robot(canvas, robot)
    if urdf is not None and packing.path("trajectory.npz").is_file():
        (joints,) = read_arrays(packing.path("trajectory.npz"), "joints", hint="make the packing again")
        animate_arm(canvas, urdf, arm_joints(robot), joints, PERIOD)


def placed(step: PackingStep, boxes: dict[str, PackingBox]) -> bool:
    """Return whether a step is a place of a known box that was carried out."""
    return step.name == "place" and step.tried and step.failure is None and step.box in boxes


def packing_text(packing: Packing) -> str:
    """Return every proposed plan with the reason at the action that ended it, in Markdown."""
    result = packing.info
    outcome = "packed" if result.success else "not packed"
    rows = [f"**{outcome}**: {result.name} by {result.proposer}; {result.proposer_calls} proposals, "]
    rows[0] += f"{result.motion_planner_calls} motion-planner calls"
    for number, attempt in enumerate(result.attempts, 1):
        rows += ["", f"Plan {number}", ""]
        for step in attempt.steps:
            where = "" if step.x is None else f" at {step.x:.3f}, {step.y or 0.0:.3f}, yaw {step.yaw or 0.0:.2f}"
            result_text = "not tried" if not step.tried else "ok" if step.failure is None else step.failure.message
            rows.append(f"- {step.name} {step.box}{where}: {result_text}")
        if attempt.task is not None:
            rows.append(f"- {attempt.task.message}")
    if result.stopped is not None:
        rows += ["", f"Stopped: {result.stopped.message}"]
    return "\n".join(rows)


def area_box(area: PackingArea, bottom: float, top: float) -> Box:
    """Return the box over an area between two heights [m]."""
    low, high = np.array([*area.low, bottom]), np.array([*area.high, top])
    middle, size = 0.5 * (low + high), high - low
    return Box(center=_triple(middle), orientation=(0.0, 0.0, 0.0, 1.0), size=_triple(size))


def standing_box(box: PackingBox, x: float, y: float, yaw: float, ground: float) -> Box:
    """Return a box of the problem standing at x, y [m], yaw [rad] on a surface at height `ground` [m]."""
    return Box(
        center=(x, y, ground + 0.5 * box.height),
        orientation=(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)),
        size=(box.width, box.length, box.height),
    )


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
