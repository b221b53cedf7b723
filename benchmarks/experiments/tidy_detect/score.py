"""Detections against the truth: who is who, and how far off."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
from scenewright.schemas.base import Model
from scenewright.stages.tableware import STANDARD, UTENSILS, Detection, Table
from scipy.optimize import linear_sum_assignment

NEAR = 0.020
"""A detection counts for an item of its kind no further away than this in the plane [m]."""
LEVEL = 0.008
"""The height of a lip is right within this [m]: half of what a bowl in a bowl adds."""
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Ends of the bins of confidence."""


class Match(Model):
    """One item, or one detection in vain."""

    kind: str | None
    """Of the item; None for a detection in vain."""
    found: str | None
    """Kind that was detected: the item's own, another at its place, `unknown`; None for an item that was missed."""
    stacked: bool = False
    """Whether the item carries something or is carried."""
    dx: float = 0.0
    dy: float = 0.0
    """Detected less true [m]."""
    turn: float = 0.0
    """Detected less true yaw [rad], -pi to pi, of a utensil."""
    lip: float = 0.0
    """Detected less true height of the upper edge [m]."""
    confidence: float = 0.0
    unsure: tuple[str, ...] = ()
    hidden: bool = False

    @property
    def right(self) -> bool:
        """Whether the item was found as what it is."""
        return self.kind is not None and self.kind == self.found


def _distances(table: Table, kind: str | None, other: str | None, ones: Sequence[Detection]) -> np.ndarray:
    """Return (items, detections) distances in the plane [m], infinite between those of other kinds than these."""
    result = np.full((len(table.items), len(ones)), np.inf)
    for r, item in enumerate(table.items):
        for c, one in enumerate(ones):
            if (kind is None or item.kind == kind) and (other is None or one.kind == other):
                result[r, c] = np.hypot(item.position[0] - one.position[0], item.position[1] - one.position[1])
    return result


def compare(table: Table, detections: tuple[Detection, ...]) -> list[Match]:
    """Return matches of least total distance (Hungarian method), kind by kind; lips count with a third of their
    difference, so that dishes of one kind in a stack find their own level. What is left over of both is matched across
    kinds, by the plane and within LEVEL: a confusion, and no item found."""
    items = table.items
    lips = np.array([[abs(item.lip - one.lip) for one in detections] for item in items]).reshape(len(items), -1)
    pairs: dict[int, int] = {}
    for kind in (*sorted({item.kind for item in items}), None):
        plane = _distances(table, kind, kind, detections)
        if kind is None:
            plane[lips > LEVEL] = np.inf
            plane[:, [c for c, one in enumerate(detections) if one.kind is None]] = np.inf
        plane[list(pairs)] = np.inf
        plane[:, list(pairs.values())] = np.inf
        rows, columns = linear_sum_assignment(np.where(plane < NEAR, plane + lips / 3.0, 10.0))
        pairs |= {int(r): int(c) for r, c in zip(rows, columns, strict=True) if plane[r, c] < NEAR}
    result = []
    for r, item in enumerate(items):
        stacked = item.on is not None or bool(table.carried[item.name])
        if r not in pairs:
            result.append(Match(kind=item.kind, found=None, stacked=stacked))
            continue
        one = detections[pairs[r]]
        turn = float(np.angle(np.exp(1j * (one.yaw - item.yaw)))) if not item.is_dish else 0.0
        result.append(
            Match(
                kind=item.kind,
                found=one.kind,
                stacked=stacked,
                dx=one.position[0] - item.position[0],
                dy=one.position[1] - item.position[1],
                turn=turn,
                lip=one.lip - item.lip,
                confidence=one.confidence,
                unsure=one.unsure,
                hidden=one.hidden,
            )
        )
    for c, one in enumerate(detections):
        if c not in pairs.values():
            result.append(
                Match(
                    kind=None,
                    found=one.kind or "unknown",
                    confidence=one.confidence,
                    unsure=one.unsure,
                    hidden=one.hidden,
                )
            )
    return result


def counts(matches: Sequence[Match], kind: str) -> tuple[int, int, int]:
    """Return how many items of a class (or `all`) are right, how many were said to be there, how many are."""
    true = [m for m in matches if m.kind is not None and kind in ("all", m.kind)]
    found = [m for m in matches if m.found is not None and (kind == m.found or kind == "all" != m.found != "unknown")]
    return sum(m.right for m in true), len(found), len(true)


def measures(matches: Iterable[Match]) -> dict[str, dict[str, float]]:
    """Return class -> measure -> value; `all` and `unknown` beside the kinds. Shares of nothing are left out."""
    rows = list(matches)
    result: dict[str, dict[str, float]] = {}
    for kind in ("all", *STANDARD.kinds, "unknown"):
        number_right, found, true = counts(rows, kind)
        if not true and not found:
            continue
        values = {"items": float(true), "found": float(found)}
        if kind == "unknown":
            result[kind] = values
            continue
        if found:
            values["precision"] = number_right / found
        if true:
            values["recall"] = number_right / true
        if number_right:
            right = [m for m in rows if m.right and kind in ("all", m.kind)]
            values |= _errors(right, utensil=kind in UTENSILS)
        result[kind] = values
    return result


def _errors(right: list[Match], utensil: bool) -> dict[str, float]:
    centers = [1e3 * np.hypot(m.dx, m.dy) for m in right]
    values = {
        "center_mm": float(np.mean(centers)),
        "center_p95_mm": float(np.percentile(centers, 95)),
        "height_right": float(np.mean([abs(m.lip) < LEVEL for m in right])),
        "sure_share": float(np.mean([not m.unsure for m in right])),
    }
    piles = [abs(m.lip) < LEVEL for m in right if m.stacked]
    if piles:
        values["stack_height_right"] = float(np.mean(piles))
    if utensil:
        turns = np.abs([m.turn for m in right])
        values["angle_deg"] = float(np.rad2deg(np.minimum(turns, np.pi - turns).mean()))
        values["head_right"] = float(np.mean(turns < np.pi / 2))
    return values


def reliability(matches: Iterable[Match]) -> tuple[list[tuple[float, float, int, float, float]], float]:
    """Return bins (low, high, count, mean confidence, share right), and the expected calibration error: the mean over
    detections of how far their bin's confidence is from its share. Things of unknown kind claim nothing."""
    claims = [(m.confidence, m.right) for m in matches if m.found not in (None, "unknown")]
    groups: dict[int, list[tuple[float, bool]]] = defaultdict(list)
    for confidence, right in claims:
        groups[min(int(np.searchsorted(BINS, confidence, side="right")), len(BINS) - 1)].append((confidence, right))
    bins = [
        (BINS[k - 1], BINS[k], len(ones), float(np.mean([c for c, _ in ones])), float(np.mean([r for _, r in ones])))
        for k, ones in sorted(groups.items())
    ]
    error = sum(count * abs(mean - share) for _, _, count, mean, share in bins) / max(len(claims), 1)
    return bins, error
