"""The demo's goal, when none is given: take an item out of furniture with a door, put it on a table, shut the door."""

from __future__ import annotations

import numpy as np

from stages.plan.strips import Atom, atom_text
from stages.plan.world_model import WorldModel

TABLE_CLASSES = ("table", "desk")


def default_goals(model: WorldModel, initial: frozenset[Atom], most: int = 6) -> list[tuple[str, ...]]:
    """Return candidate goals, the preferred first: `on(item, table)` and `closed(container)`.

    Rule: every item that the contact graph puts inside a container behind a door, with every table (or desk).
    Items behind an open door come before those behind a closed one, items that the gripper can close on before wider
    ones, then the nearer table, then names. Empty when there is no such item or no table.
    """
    tables = [name for name, record in model.records.items()
              if record.class_name in TABLE_CLASSES and any(plane.horizontal for plane in model.planes[name])]  # fmt: skip
    inside = {atom[1]: atom[2] for atom in initial if atom[0] == "in"}
    behind = {atom[1]: atom[2] for atom in initial if atom[0] == "behind"}
    ranked = []
    for item, container in inside.items():
        width = model.records[item].grasp_width
        wide = width is not None and width > model.description.opening
        shut = ("open", behind[item]) not in initial
        for table in tables:
            away = float(np.linalg.norm(model.pose(table)[:2, 3] - model.pose(container)[:2, 3]))
            ranked.append((wide, shut, round(away, 3), item, table, container))
    goals = []
    for _, _, _, item, table, container in sorted(ranked):
        goals.append((atom_text(("on", item, table)), atom_text(("closed", container))))
    return goals[:most]
