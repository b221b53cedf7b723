"""Figures of a plan: the task plans that were tried, and base and joints over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from scenewright.schemas.plan import Plan, PlanFile, TriedPlan
from scenewright.stages.kit.drawing.plan_tree import REACHED, Branch, plan_tree
from scenewright.stages.kit.formats.numpy_files import read_arrays

WIDTH, HEIGHT = 10.0, 5.4
"""Size of a figure [inch]."""
SHADE = "#f0f3f6"
ARM_JOINTS = 7
"""Columns of `joints` before those of the fingers."""


def tried_tree(file: PlanFile) -> Figure:
    """Return the task plans that geometry tried as one tree, the reason at each that was given up."""
    return plan_tree([_branch(tried) for tried in file.tried], "Task plans that were tried")


def _branch(tried: TriedPlan) -> Branch:
    ended = len(tried.actions) if tried.failed_action is None else tried.failed_action
    steps = tuple((action, _short(action)) for action in tried.actions[:ended])
    if tried.failure is None:
        return Branch(steps, "every action has a motion", REACHED)
    return Branch(steps, f"{_short(tried.actions[ended])}: {tried.failure.message}")


def _short(action: str) -> str:
    """`open(fridge_7__door_hinge)` -> `open fridge_7 door`: a label that fits into a box."""
    name, _, arguments = action.rstrip(")").partition("(")
    first = arguments.split(",")[-1 if name == "drive" else 0].strip()
    return f"{name}\n{first.replace('__', ' ').removesuffix('_hinge').removesuffix('_slide')}"


def motion_figure(plan: Plan) -> Figure:
    """Return base pose and joint values over time, the actions shaded in turn. Raises BadInput for a torn file."""
    time, joints, base = read_arrays(
        plan.path("trajectory.npz"), "time", "joints", "world_from_base", shapes=("N", "N J", "N 4 4")
    )
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=110, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
    yaw = np.unwrap(np.arctan2(base[:, 1, 0], base[:, 0, 0]))
    for values, name in ((base[:, 0, 3], "x [m]"), (base[:, 1, 3], "y [m]"), (yaw, "yaw [rad]")):
        above.plot(time, values, linewidth=1.0, label=name)
    for number in range(joints.shape[1]):
        finger = number >= ARM_JOINTS
        scale, name = (100.0, f"finger {number - ARM_JOINTS + 1} [cm]") if finger else (1.0, f"joint {number + 1}")
        below.plot(time, scale * joints[:, number], linewidth=0.8 if finger else 1.0, label=name)
    for axes, unit in ((above, "base"), (below, "arm [rad]")):
        for number, action in enumerate(plan.info.actions):
            if not 0 <= action.start < action.end <= len(time):
                continue
            if number % 2 == 0:
                axes.axvspan(time[action.start], time[action.end - 1], color=SHADE, zorder=0)
            if axes is above:
                middle = 0.5 * (time[action.start] + time[action.end - 1])
                axes.text(middle, 1.02, action.name, transform=axes.get_xaxis_transform(), fontsize=7, ha="center")
        axes.set_ylabel(unit)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    below.set_xlabel("time [s]")
    return figure
