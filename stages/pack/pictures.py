"""Pictures of a run: the basket from above with every placement that was tried, the plans as a tree with the reason at
each branch that was cut, the scene at the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from PIL import Image
from scenewright.stages.kit.drawing.plan_tree import CUT, REACHED, UNMET, Branch, plan_tree
from scenewright.stages.pack.environment import PackingWorld, clipped
from scenewright.stages.pack.hand import held_block, place_tool_pose
from scenewright.stages.pack.loop import PackingRun
from scenewright.stages.pack.records import Action, Attempt, BoxState
from scenewright.stages.pack.scene_picture import render_scene

BOX_COLORS = {
    "red": "#c8553d",
    "blue": "#3d6cb9",
    "green": "#5b9a5f",
    "tan": "#cdb18a",
    "cyan": "#5fb8c4",
    "yellow": "#dfc04e",
    "purple": "#8a6bb1",
    "orange": "#dd8a45",
    "white": "#dddddd",
    "brown": "#8a6a52",
}
OTHER = "#9aa5ad"
REFUSED = CUT
MOST_REFUSED = 60
"""Most refused placements that are drawn; by eye."""
DOTS = 100
"""Resolution of a picture [px/inch]."""


def box_color(name: str) -> str:
    """Return the colour that a box's name says."""
    return BOX_COLORS.get(name.split("_")[0], OTHER)


def _corners(box: BoxState, x: float, y: float, yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [box.width / 2, box.length / 2]
    return half @ np.array([[c, s], [-s, c]]) + [x, y]


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(path, metadata={"Software": None})


def draw_layout(path: Path, world: PackingWorld, run: PackingRun, width: int) -> None:
    """Draw the table from above: starts, the boxes at the end, refused placements in red, the rim of the reach."""
    instance = world.instance
    figure = Figure(figsize=(width / DOTS, 0.8 * width / DOTS), dpi=DOTS, layout="constrained")
    axes = figure.add_subplot()
    low, high = instance.basket.low, instance.basket.high
    axes.add_patch(Rectangle(low, high[0] - low[0], high[1] - low[1], facecolor="#efe6d6", edgecolor="#7a6a4f"))
    for obstacle in instance.obstacles:
        corner, end = obstacle.rectangle.low, obstacle.rectangle.high
        axes.add_patch(
            Rectangle(corner, end[0] - corner[0], end[1] - corner[1], facecolor="#555555", hatch="//", edgecolor="w")
        )
        axes.text(
            (corner[0] + end[0]) / 2,
            (corner[1] + end[1]) / 2,
            f"{1000 * obstacle.top:.0f} mm",
            ha="center",
            va="center",
            fontsize=7,
            color="w",
        )
    boxes = {box.name: box for box in instance.boxes}
    for box in instance.boxes:
        axes.add_patch(Polygon(_corners(box, box.x, box.y, box.yaw), fill=False, linestyle=":", edgecolor="#777777"))
    refused = [
        step.action
        for attempt in run.attempts
        for step in attempt.feedback
        if step.failure is not None and step.action.name == "place" and step.action.box in boxes
    ]
    for action in refused[-MOST_REFUSED:]:
        corners = _corners(boxes[action.box], *clipped(action))
        axes.add_patch(Polygon(corners, fill=False, edgecolor=REFUSED, linewidth=0.8, alpha=0.7))
    for name in boxes:
        box = world.box(run.states[-1], name)
        patch = Polygon(_corners(box, box.x, box.y, box.yaw), facecolor=box_color(name), edgecolor="k", alpha=0.9)
        axes.add_patch(patch)
        axes.text(
            box.x, box.y, f"{name.removesuffix('_box')}\n{1000 * box.height:.0f}", ha="center", va="center", fontsize=7
        )
    lowest = min(place_tool_pose(box, 0.0, 0.0, 0.0).z for box in instance.boxes)
    reach = world.planner.arm.reach(lowest)
    angles = np.linspace(-0.5, 0.5, 100)
    axes.plot(reach * np.cos(angles), reach * np.sin(angles), color="#3d6cb9", linestyle="--", linewidth=1)
    margin = 0.06
    axes.set_xlim(low[0] - margin, max(high[0], reach) + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]; dashed: rim of the arm's reach; red: placements refused")
    axes.set_ylabel("y [m]")
    axes.set_title(
        f"{instance.name}: {'packed' if run.success else 'not packed'}, {run.proposer_calls} proposals, "
        f"{run.motion_calls} motion-planner calls",
        fontsize=10,
    )
    _save(figure, path)


def _branch(attempt: Attempt) -> Branch:
    """Return the placements of an attempt that went through, and what ended it."""
    steps: list[tuple[Action, str]] = []
    for step in attempt.feedback:
        if step.failure is not None:
            return Branch(tuple(steps), f"{step.action.name} {step.action.box}: {step.failure.message}")
        if step.action.name == "place":
            label = f"{step.action.box.removesuffix('_box')} ({step.action.x:.2f}, {step.action.y:.2f})"
            steps.append((step.action, label))
    end, color = (attempt.task.message, UNMET) if attempt.task else ("goal reached", REACHED)
    return Branch(tuple(steps), end, color)


def draw_attempts(path: Path, attempts: tuple[Attempt, ...], width: int) -> None:
    """Draw the plans as one tree: shared placements once, and at each end why the plan was cut there."""
    _save(plan_tree([_branch(attempt) for attempt in attempts], "Plans that were proposed", width), path)


def draw_scene(path: Path, world: PackingWorld, run: PackingRun, width: int) -> None:
    """Render the scene as it is after the last action that was carried out."""
    state = run.states[-1]
    blocks = [(entry.name, entry.block) for entry in world.standing(state, state.held)]
    if state.held is not None:
        box = world.box(state, state.held)
        blocks.append((state.held, held_block(state.stance.pose, box.width, box.length, box.height)))
    colors = {name: box_color(name) for name, _ in blocks}
    for obstacle in world.instance.obstacles:
        colors[obstacle.rectangle.name] = "#555555"
    image = render_scene(world.planner.arm, state.stance.arm, blocks, colors, world.instance.basket, width)
    Image.fromarray(image).save(path)
