"""A packing for the page: what came of it, every plan with what ended it, the pictures that its step drew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scenewright.schemas.packing import Packing, PackingAttempt
from scenewright.stages.report.images import Picture, from_file
from scenewright.stages.report.page import Page

WIDTH = 1100
"""Largest width of pictures [px]."""
MOST_ROWS = 60
"""Most plans that are listed."""
PICTURES = {
    "layout": "The basket from above after the last plan; red: placements that were refused",
    "scene": "After the last action that was carried out",
    "attempts": "The plans as a tree; red: the reason at each branch that was cut",
}


@dataclass(frozen=True)
class AttemptRow:
    """A plan that was proposed."""

    number: int
    placed: str
    """Boxes that it put down, of those that it would have, e.g. `3 of 4`."""
    ended_at: str
    """The action without a motion; empty when every action has one."""
    why: str
    """What ended it: the failure, the goal that does not hold, or `goal reached`."""
    kind: str


@dataclass(frozen=True)
class PackingView:
    """Everything the page says about a packing."""

    name: str
    proposer: str
    success: bool
    boxes: int
    obstacles: int
    proposer_calls: int
    motion_planner_calls: int
    stopped: str
    rows: tuple[AttemptRow, ...]
    """The last plans, at most MOST_ROWS."""
    hidden: int
    """Plans before those."""
    pictures: dict[str, tuple[Picture, str]]
    """By name, with the caption; what the artifact has of them."""


def packing_view(packing: Packing, width: int) -> PackingView:
    """Read a packing; pictures are at most `width` wide [px]. Raises BadInput for a picture that cannot be read."""
    file, instance = packing.info, packing.instance
    rows = [attempt_row(number, attempt) for number, attempt in enumerate(file.attempts, start=1)]
    paths = {name: packing.path(f"{name}.png") for name in PICTURES}
    return PackingView(
        name=file.name,
        proposer=file.proposer.replace("_", " "),
        success=file.success,
        boxes=len(instance.boxes),
        obstacles=len(instance.obstacles),
        proposer_calls=file.proposer_calls,
        motion_planner_calls=file.motion_planner_calls,
        stopped=file.stopped.message if file.stopped is not None else "",
        rows=tuple(rows[-MOST_ROWS:]),
        hidden=max(0, len(rows) - MOST_ROWS),
        pictures={
            name: (from_file(path, PICTURES[name], width), PICTURES[name])
            for name, path in paths.items()
            if path.is_file()
        },
    )


def attempt_row(number: int, attempt: PackingAttempt) -> AttemptRow:
    """Return the row of a plan: how far it came, and what ended it."""
    places = [step for step in attempt.steps if step.name == "place"]
    done = sum(step.tried and step.failure is None for step in places)
    placed = f"{done} of {len(places)}"
    for step in attempt.steps:
        if step.failure is not None:
            where = "" if step.x is None or step.y is None else f" at ({step.x:.3f}, {step.y:.3f})"
            return AttemptRow(number, placed, f"{step.name} {step.box}{where}", step.failure.message, step.failure.kind)
    if attempt.task is not None:
        return AttemptRow(number, placed, "", attempt.task.message, attempt.task.kind)
    return AttemptRow(number, placed, "", "goal reached", "")


def view(page: Page) -> dict[str, Any] | None:
    """Return the packing with its pictures."""
    packing = page.given("packing", Packing)
    return {"packing": packing_view(packing, WIDTH)} if packing is not None else None
