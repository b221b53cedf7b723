"""Tableware: a table as it stands, a plan as text and pictures, a table being cleared over time, policies compared."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.outside import LARGEST_SHOWN, file_content, file_text
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_plan import TablewarePlan
from scenewright.schemas.tableware_scene import TablewareItem, TablewareScene
from scenewright.schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.meshes import draw_solid

TABLE = (0.78, 0.61, 0.03)
"""Extents of the table top [m]; its surface is at z = 0."""
TABLE_COLOR = (0.84, 0.83, 0.8)
"""Colour of the table (sRGB, 0 to 1)."""
BIN_AT, BIN_PITCH, BIN_COLUMNS = (0.62, -0.4), 0.2, 5
"""Where what came to the bin is shown [m]: beside the table, in rows."""


def draw_tableware_scene(scene: TablewareScene, canvas: Canvas) -> None:
    """Draw the table as it truly stands and the image of it."""
    file = scene.info
    _table(canvas)
    _shapes(scene, file.items, canvas)
    for item in file.items:
        canvas.transform(f"items/{item.name}", _pose(item))
    canvas.transform("camera", np.array(file.world_from_camera))
    canvas.camera("camera", file.camera)
    canvas.picture("camera/color", file_content(scene.path("color.png"), LARGEST_SHOWN))


def draw_tableware_detections(found: TablewareDetections, canvas: Canvas) -> None:
    """Show what was seen: the statement, the picture, and every item as a point at its lip, green by confidence."""
    file = found.info
    canvas.document("seen", "\n\n".join([file.statement, *file.notes]))
    canvas.picture("overlay", file_content(found.path("overlay.png"), LARGEST_SHOWN))
    _table(canvas)
    for number, item in enumerate(file.items, start=1):
        share = item.confidence if item.kind is not None else 0.0
        color = np.array([[round(255 * (1.0 - share)), round(200 * share), 40]], np.uint8)
        center = np.array([[item.position[0], item.position[1], item.lip]])
        canvas.points(f"items/{number}_{item.kind or 'unknown'}", center, color, radius=0.01)


def draw_tableware_plan(plan: TablewarePlan, canvas: Canvas) -> None:
    """Show the plan in words, its pictures, and pulls and stackings as lines over the table."""
    canvas.document("plan", file_text(plan.path("plan.txt"), LARGEST_SHOWN))
    _table(canvas)
    for name in ("strip", "detections"):
        if plan.path(f"{name}.png").is_file():
            canvas.picture(name, file_content(plan.path(f"{name}.png"), LARGEST_SHOWN))
    for number, step in enumerate(plan.info.steps, start=1):
        action = step.action
        pull = action.u_P or (action.u_PG.u_P if action.u_PG else None)
        put = action.u_S or (action.u_SG.u_S if action.u_SG else None)
        if pull is not None:
            canvas.line(f"pulls/{number}", [np.array([pull.p_S, pull.p_E])], [(0.08, 0.5, 0.24)], labels=[pull.item])
        if put is not None:
            canvas.line(f"stackings/{number}", [np.array([put.u_G.p_G, put.p_L])], [(0.49, 0.23, 0.93)])


def draw_tableware_trial(trial: TablewareTrial, canvas: Canvas) -> None:
    """Draw the table being cleared: each thing where it is after each action; what was binned stands beside the
    table."""
    file = trial.info
    canvas.document("trial", file_text(trial.path("trial.txt"), LARGEST_SHOWN))
    _table(canvas)
    canvas.picture("keyframes", file_content(trial.path("keyframes.png"), LARGEST_SHOWN))
    first = file.steps[0].before if file.steps else ()
    _shapes(trial, first, canvas)
    canvas.time(0.0)
    for item in first:
        canvas.transform(f"items/{item.name}", _pose(item))
    binned = 0
    for number, step in enumerate(file.steps, 1):
        lost = f": {', '.join(step.dropped)} fell" if step.dropped else ""
        canvas.moment(step.end, f"action {number}{lost}", bad=bool(step.dropped))
        canvas.time(step.end)
        for item in step.after:
            canvas.transform(f"items/{item.name}", _pose(item))
        for name in (*step.binned, *step.dropped):
            row, column = divmod(binned, BIN_COLUMNS)
            pose = np.eye(4)
            pose[:3, 3] = (BIN_AT[0] + BIN_PITCH * row, BIN_AT[1] + BIN_PITCH * column, -0.03)
            canvas.transform(f"items/{name}", pose)
            binned += 1


def draw_tableware_evaluation(evaluation: TablewareEvaluation, canvas: Canvas) -> None:
    """Show the table of policies."""
    canvas.document("policies", file_text(evaluation.path("table.md"), LARGEST_SHOWN))


def _table(canvas: Canvas) -> None:
    top = Box(center=(0.0, 0.0, -TABLE[2] / 2), orientation=(0.0, 0.0, 0.0, 1.0), size=TABLE)
    draw_solid("table", top, TABLE_COLOR, canvas)


def _shapes(artifact: Artifact, items: tuple[TablewareItem, ...], canvas: Canvas) -> None:
    meshes = {kind: read_mesh(artifact.path(f"shapes/{kind}.ply")) for kind in {item.kind for item in items}}
    for item in items:
        canvas.mesh(f"items/{item.name}", meshes[item.kind])


def _pose(item: TablewareItem) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(item.yaw), -np.sin(item.yaw)], [np.sin(item.yaw), np.cos(item.yaw)]]
    pose[:3, 3] = item.position
    return pose
