"""The interactive scene and the plan for the page."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import Check, Failure, Plan
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.report.images import Picture, from_figure, from_file
from scenewright.stages.report.motion_figures import motion_figure, tried_tree


@dataclass(frozen=True)
class BodyRow:
    """A body of the interactive scene."""

    name: str
    class_name: str
    movable: bool
    place: str
    """On or in what."""
    mass: str
    joints: tuple[str, ...]
    because: str = ""
    """What of it is inferred, or why it is held."""


@dataclass(frozen=True)
class ActionRow:
    """An action of the plan with its share of the motion."""

    number: int
    text: str
    seconds: str


@dataclass(frozen=True)
class PlanView:
    """Everything the page says about a plan."""

    status: str
    goal: tuple[str, ...]
    planned_in: str
    executed_in: str
    actions: tuple[ActionRow, ...]
    keyframes: tuple[tuple[Picture, str], ...]
    checks: tuple[Check, ...]
    failures: tuple[tuple[Failure, int], ...]
    """Each kind of failure of each action once, with how often it was met; in order of the last time."""
    seconds: str
    tree: Picture | None = None
    """Task plans that geometry tried, with the reason at each that was given up."""
    joints: Picture | None = None
    """Base and arm over the time of the motion."""


def body_rows(scene: InteractiveScene) -> list[BodyRow]:
    """Bodies with joints first, then the movable ones, then the rest."""
    rows = []
    for body in scene.info.bodies:
        joints = []
        for joint in body.joints:
            value = body.joint_values.get(joint.name, 0.0)
            name = joint.name.removeprefix(f"{body.name}__")
            if joint.type == "revolute":
                low, high, now = (np.degrees(v) for v in (joint.lower, joint.upper, value))
                joints.append(f"{name}: hinge {low:.0f}° to {high:.0f}°, seen at {now:.0f}°")
            else:
                low, high, now = (100 * v for v in (joint.lower, joint.upper, value))
                joints.append(f"{name}: slide {low:.0f} to {high:.0f} cm, seen at {now:.0f} cm")
        rows.append(
            BodyRow(
                body.name,
                body.class_name,
                body.movable,
                _place(body.relation, body.parent),
                f"{body.mass:.2f} kg",
                tuple(joints),
                body.because,
            )
        )
    return sorted(rows, key=lambda r: (not r.joints, not r.movable, r.name))


def _place(relation: str, parent: str | None) -> str:
    if relation == "unknown":
        return "on nothing known"
    if parent is None or parent == SCENE_NODE:
        return "part of the room"
    word = {"contains": "in", "carries_on_wall": "hangs on", "hangs_from": "hangs from"}.get(relation, "on")
    return f"{word} {parent}"


def plan_view(plan: Plan, most: int, width: int) -> PlanView:
    """Read a plan with its key frames, evenly thinned to at most `most`."""
    file = plan.info
    times = _times(plan)
    actions = []
    for k, action in enumerate(file.actions):
        span = ""
        if times is not None and 0 <= action.start < action.end <= len(times):
            span = f"{times[action.end - 1] - times[action.start]:.1f} s"
        actions.append(ActionRow(k + 1, f"{action.name}({', '.join(action.arguments)})", span))
    frames = sorted(
        (path for path in (plan.root / "keyframes").glob("*") if path.suffix.lower() in (".png", ".jpg")),
        key=lambda path: (_leading_number(path.stem), path.name),
    )
    if len(frames) > most:
        frames = [frames[round(k)] for k in np.linspace(0, len(frames) - 1, most)] if most else []
    keyframes = []
    for path in frames:
        caption = re.sub(r"^\d+_?", "", path.stem).replace("_", " ") or path.stem
        keyframes.append((from_file(path, f"key frame: {caption}", width), caption))
    return PlanView(
        status=file.status.replace("_", " "),
        goal=file.goal,
        planned_in=file.planned_in.replace("_", " "),
        executed_in=(file.executed_in or "").replace("_", " "),
        actions=tuple(actions),
        keyframes=tuple(keyframes),
        checks=file.checks,
        failures=_together(file.failures),
        seconds="" if times is None or not len(times) else f"{times[-1] - times[0]:.0f} s",
        tree=from_figure(tried_tree(file), "task plans that were tried") if file.tried else None,
        joints=from_figure(motion_figure(plan), "joints over time") if times is not None and len(times) > 1 else None,
    )


def _together(failures: tuple[Failure, ...]) -> tuple[tuple[Failure, int], ...]:
    last: dict[tuple[str, str | None, tuple[str, ...]], tuple[Failure, int]] = {}
    for failure in failures:
        key = (failure.kind, failure.action, failure.objects)
        count = last.pop(key, (failure, 0))[1]
        last[key] = (failure, count + 1)
    return tuple(last.values())


def _times(plan: Plan) -> np.ndarray | None:
    path = plan.path("trajectory.npz")
    if not path.is_file():
        return None
    (times,) = read_arrays(path, "time", shapes=("N",))
    return times.astype(float)


def _leading_number(stem: str) -> int:
    match = re.match(r"\d+", stem)
    return int(match[0]) if match else 10**9
