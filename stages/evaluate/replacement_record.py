"""Metrics and tables of CAD replacement in the evaluation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.stages.evaluate.replacement_measures import ObjectResult, RoomReplacements
from scenewright.stages.evaluate.results import Part
from scenewright.stages.kit.measurement.room_penetrations import Penetration
from scenewright.stages.kit.measurement.tables import Cell, Table

NOTE = (
    "Replacement: a thing succeeds (Scan2CAD, Avetisyan et al. 2019) when the chosen model is of its class and "
    "stands within 0.20 m, 20 degrees and 20 % of the true one; missed and unreplaced things fail, except in the "
    "shares that end in `_detected`. Translation is between the middles of the closed models' boxes, rotation modulo "
    "the symmetry of the true model (models with joints have none), scale the mean ratio of the three extents. "
    "Collisions are pairs more than 5 mm deep, volumes are counted on a grid. The four criteria of functional "
    "equivalence are those of Han 2024, section 2.1, with our thresholds: extents within 20 % or 2 cm and surfaces "
    "within 5 % of the diagonal, mean colours within a CIE 1976 difference of 20."
)


def record_replacements(part: Part, measured: RoomReplacements) -> None:
    """Record `room_summary` under the part's name, and tables of objects, equivalence, joints and penetrations."""
    for name, value in measured.summary.items():
        part.set(name, value)
    if NOTE not in part.notes:
        part.notes.append(NOTE)
    stem = part.name
    part.tables += [
        alignment_table(stem, measured.objects),
        equivalence_table(stem, measured.objects),
        joint_table(stem, measured.objects),
        penetration_table(stem, measured.penetrations),
    ]


def alignment_table(stem: str, objects: Sequence[ObjectResult]) -> Table:
    """One row an object: what was chosen, its rank, its errors, whether it succeeds."""
    rows: list[tuple[Cell, ...]] = []
    for r in objects:
        error = r.alignment
        ratios = None if error is None else " ".join(f"{ratio:.2f}" for ratio in error.scale_ratios)
        rows.append(
            (
                r.name,
                r.node,
                r.decision,
                r.true_model,
                r.model,
                r.rank,
                None if error is None else 1e3 * error.translation,
                None if error is None else float(np.degrees(error.rotation)),
                ratios,
                _yes(r.success),
            )
        )
    columns = (
        "true thing",
        "node",
        "decision",
        "true model",
        "model",
        "rank of the true model",
        "translation [mm]",
        "rotation [deg]",
        "extents over true extents",
        "success",
    )
    return Table(f"{stem}_objects", "CAD replacement against the truth", columns, tuple(rows))


def equivalence_table(stem: str, objects: Sequence[ObjectResult]) -> Table:
    """One row an object: the four criteria of functional equivalence."""
    rows: list[tuple[Cell, ...]] = []
    for r in objects:
        e = r.equivalence
        if e is None:
            rows.append((r.name, r.node, *[None] * 7, "no"))
            continue
        rows.append(
            (
                r.name,
                r.node,
                _yes(e.same_class),
                _yes(e.same_relation),
                _yes(e.affordance),
                _yes(e.size),
                _yes(e.shape),
                _yes(e.appearance),
                e.color_difference,
                _yes(e.functional),
            )
        )
    columns = (
        "true thing",
        "node",
        "class",
        "carried by the same",
        "affordance",
        "size",
        "shape",
        "appearance",
        "colour difference",
        "functional",
    )
    return Table(f"{stem}_equivalence", "Functional equivalence of the replacements", columns, tuple(rows))


def joint_table(stem: str, objects: Sequence[ObjectResult]) -> Table:
    """One row a true joint of a replaced object."""
    rows: list[tuple[Cell, ...]] = [
        (
            r.name,
            joint.joint,
            joint.type,
            joint.partner,
            None if joint.angle is None else float(np.degrees(joint.angle)),
            None if joint.offset is None else 1e3 * joint.offset,
            joint.limits,
            joint.value,
        )
        for r in objects
        for joint in r.joints
    ]
    columns = (
        "true thing",
        "joint",
        "type",
        "stands for it",
        "axis angle [deg]",
        "axis offset [mm]",
        "limit error [rad or m]",
        "value error [rad or m]",
    )
    return Table(f"{stem}_joints", "Joints of the replacements", columns, tuple(rows))


def penetration_table(stem: str, penetrations: Sequence[Penetration]) -> Table:
    """One row a pair that shares space, deepest first."""
    rows: list[tuple[Cell, ...]] = [
        (p.first, p.second, 1e3 * p.depth, 1e6 * p.volume, _yes(p.collides)) for p in penetrations
    ]
    columns = ("first", "second", "depth [mm]", "shared volume [cm^3]", "collides")
    return Table(f"{stem}_penetrations", "Penetrations of the replaced scene", columns, tuple(rows))


def _yes(value: bool) -> str:
    return "yes" if value else "no"
