"""Cutting: demonstrations and models in words, plans and trials with their pictures and the bodies as they lie."""

from __future__ import annotations

import math

import numpy as np
import trimesh
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.cutting_demonstrations import CuttingDemonstrations
from scenewright.schemas.cutting_model import CuttingModel
from scenewright.schemas.cutting_plan import CuttingEvaluation, CuttingPlan, CuttingTrial
from scenewright.schemas.outside import LARGEST_SHOWN, file_content, file_text
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.viewing.canvas import Canvas


def draw_cutting_demonstrations(shown: CuttingDemonstrations, canvas: Canvas) -> None:
    """Show some trials before and after."""
    canvas.document("demonstrations", shown.info.statement)
    _picture(shown, "sheet", canvas)


def draw_cutting_model(model: CuttingModel, canvas: Canvas) -> None:
    """Show types and rules as a table."""
    file = model.info
    rows = [file.statement, "", "| type | edges [mm] | share |", "|---|---|---|"]
    for number, kind in enumerate(file.grammar.types):
        edges = " x ".join(f"{1e3 * math.exp(edge):.0f}" for edge in kind.mean)
        rows.append(f"| {number} | {edges} | {kind.share:.2f} |")
    rows += ["", "| rule | seen |", "|---|---|"]
    rows += [f"| {r.parent}, axis {r.axis}: {r.children[0]} {r.children[1]} | {r.seen} |" for r in file.grammar.rules]
    canvas.document("grammar", "\n".join(rows))


def draw_cutting_plan(plan: CuttingPlan, canvas: Canvas) -> None:
    """Show the tree of cuts and the fragments."""
    canvas.document("plan", file_text(plan.path("plan.txt"), LARGEST_SHOWN))
    _picture(plan, "fragments", canvas)
    _picture(plan, "tree", canvas)
    _bodies(plan, canvas, plan.info.objects + plan.info.goal_bodies)


def draw_cutting_trial(trial: CuttingTrial, canvas: Canvas) -> None:
    """Show what came of it, and the fragments as they lie."""
    canvas.document("trial", trial.info.statement)
    _picture(trial, "board", canvas)
    _bodies(trial, canvas, 0)


def draw_cutting_evaluation(evaluation: CuttingEvaluation, canvas: Canvas) -> None:
    """Show the table."""
    canvas.document("methods", file_text(evaluation.path("table.md"), LARGEST_SHOWN))


def _picture(artifact: Artifact, name: str, canvas: Canvas) -> None:
    path = artifact.path(f"{name}.png")
    if path.is_file():
        canvas.picture(name, file_content(path, LARGEST_SHOWN))


def _bodies(artifact: Artifact, canvas: Canvas, first: int) -> None:
    """Draw the bodies of an artifact from number `first` on."""
    path = artifact.path("bodies.npz")
    if not path.is_file():
        return
    vertices, faces, sizes = read_arrays(path, "vertices", "faces", "sizes", shapes=("V 3", "F 3", "N 2"))
    ends = np.cumsum(sizes, axis=0)
    for number in range(first, len(sizes)):
        (v_end, f_end), (v, f) = ends[number], sizes[number]
        mesh = trimesh.Trimesh(vertices[v_end - v : v_end], faces[f_end - f : f_end], process=False)
        color = np.round(255 * np.array(instance_color(number + 1))).astype(np.uint8)
        canvas.mesh(f"fragments/{number - first}", mesh, np.tile(color, (len(mesh.vertices), 1)))
