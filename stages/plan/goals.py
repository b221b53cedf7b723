"""The demo's goal, when none is given: take an item out of furniture with a door, put it on a table, shut the door."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.acting.hand.grip import narrowest_width
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.tasks.strips import Atom, atom_text
from scenewright.stages.plan.world_model import WorldModel

TABLE_CLASSES = ("table", "desk")
"""Classes that a goal means by a table."""


def default_goals(model: WorldModel, initial: frozenset[Atom], opening: float, most: int = 6) -> list[tuple[str, ...]]:
    """Return candidate goals, the preferred first: `on(item, table)` and `closed(container)`.

    Rule: every item that the contact graph puts inside a container behind a door, with every table (or desk).
    Items that fit between the fingers (`opening` [m]) come before wider ones, those behind an open door before those
    behind a closed one, then the nearer table, then names. Empty when there is no such item or no table.
    """
    flat = {name for name, planes in model.planes.items() if any(plane.horizontal for plane in planes)}
    tables = [name for name, record in model.records.items() if name in flat and record.class_name in TABLE_CLASSES]
    inside = {atom[1]: atom[2] for atom in initial if atom[0] == "in"}
    behind = {atom[1]: atom[2] for atom in initial if atom[0] == "behind"}
    ranked = []
    for item, container in inside.items():
        wide = narrowest_width(apply(model.pose(item), model.points(item))) > opening
        shut = ("open", behind[item]) not in initial
        for table in tables:
            away = float(np.linalg.norm(model.pose(table)[:2, 3] - model.pose(container)[:2, 3]))
            ranked.append((wide, shut, round(away, 3), item, table, container))
    goals: list[tuple[str, ...]] = []
    for _, _, _, item, table, container in sorted(ranked):
        goals.append((atom_text(("on", item, table)), atom_text(("closed", container))))
    return goals[:most]
