"""Detections against the truth: who is who, and how far off."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from stages.tableware.vision.detections import Detection
from stages.tableware.world.items import Table

NEAR = 0.020
"""A detection counts for an item of its kind no further away than this in the plane [m]."""
LEVEL = 0.008
"""The height of a lip is right within this [m]: half of what a bowl in a bowl adds."""


@dataclass(frozen=True)
class Match:
    """One item or one detection: `kind`; matched or not; errors when matched."""

    kind: str
    true: bool
    found: bool
    center: float = 0.0
    """[m]"""
    angle: float = 0.0
    """[rad], utensils, head and handle told apart."""
    height_right: bool = False
    sure: bool = True
    hidden: bool = False


def compare(table: Table, detections: tuple[Detection, ...]) -> list[Match]:
    """Return matches of least total distance (Hungarian method), kind by kind; lips count with a third of their
    difference, so that dishes of one kind in a stack find their own level. Things of unknown kind count as found in
    vain under the kind `unknown`."""
    result = [Match("unknown", False, True) for one in detections if one.kind is None]
    for kind in sorted({item.kind for item in table.items} | {one.kind for one in detections if one.kind}):
        items = [item for item in table.items if item.kind == kind]
        ours = [one for one in detections if one.kind == kind]
        plane = np.array([[np.hypot(i.position[0] - d.position[0], i.position[1] - d.position[1]) for d in ours]
                          for i in items]).reshape(len(items), len(ours))  # fmt: skip
        lips = np.array([[abs(i.lip - d.lip) for d in ours] for i in items]).reshape(plane.shape)
        rows, columns = linear_sum_assignment(np.where(plane < NEAR, plane + lips / 3.0, 10.0))
        pairs = [(r, c) for r, c in zip(rows, columns, strict=True) if plane[r, c] < NEAR]
        for r, c in pairs:
            turn = abs(np.angle(np.exp(1j * (items[r].yaw - ours[c].yaw)))) if not items[r].is_dish else 0.0
            result.append(Match(kind, True, True, float(plane[r, c]), float(turn), bool(lips[r, c] < LEVEL),
                                not ours[c].unsure, ours[c].hidden))  # fmt: skip
        result += [Match(kind, True, False) for r in range(len(items)) if r not in {r for r, _ in pairs}]
        result += [Match(kind, False, True, sure=not d.unsure, hidden=d.hidden) for c, d in enumerate(ours)
                   if c not in {c for _, c in pairs}]  # fmt: skip
    return result


def measures(matches: Iterable[Match]) -> dict[str, dict[str, float]]:
    """Return kind -> measure -> value; `all` and `unknown` beside the kinds. Shares of nothing are NaN."""
    groups: dict[str, list[Match]] = defaultdict(list)
    for match in matches:
        groups[match.kind].append(match)
        if match.kind != "unknown":
            groups["all"].append(match)
    result = {}
    for kind, ones in groups.items():
        both = [m for m in ones if m.true and m.found]
        found, true = sum(m.found for m in ones), sum(m.true for m in ones)
        values = {"items": float(true), "found": float(found)}
        values["precision"] = len(both) / found if found else float("nan")
        values["recall"] = len(both) / true if true else float("nan")
        if both:
            values["center_mm"] = 1e3 * float(np.mean([m.center for m in both]))
            values["center_p95_mm"] = 1e3 * float(np.percentile([m.center for m in both], 95))
            values["height_right"] = float(np.mean([m.height_right for m in both]))
            values["sure_share"] = float(np.mean([m.sure for m in both]))
        if both and kind in ("fork", "spoon"):
            values["angle_deg"] = float(np.rad2deg(np.mean([min(m.angle, np.pi - m.angle) for m in both])))
            values["head_right"] = float(np.mean([m.angle < np.pi / 2 for m in both]))
        result[kind] = values
    return result
