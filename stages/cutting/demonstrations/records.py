"""Demonstrations as records, and records carried out again: fragments follow from objects and planes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_vector
from scenewright.schemas.cutting_demonstrations import (
    CuttingDemonstrations,
    CuttingPlane,
    DemonstratedCut,
    DemonstrationRecord,
)
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.bodies_file import read_bodies
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.knife import Knife, Refused, cut


def plane_record(plane: Plane) -> CuttingPlane:
    """Return a plane as a record."""
    return CuttingPlane(normal=as_vector(plane.normal), d=float(plane.d))


def record_of(demonstration: Demonstration, training: bool) -> DemonstrationRecord:
    """Return a demonstration without its meshes."""
    return DemonstrationRecord(
        cell=demonstration.cell,  # type: ignore[arg-type]
        families=demonstration.families,
        cuts=tuple(
            DemonstratedCut(
                piece=each.piece,
                plane=plane_record(each.plane),
                shifts=tuple(as_vector(shift) for shift in each.shifts),  # type: ignore[arg-type]
            )
            for each in demonstration.cuts
        ),
        categories=dict(demonstration.categories),
        finished=demonstration.finished,
        training=training,
    )


def replay(record: DemonstrationRecord, objects: Sequence[Body], where: str) -> Demonstration:
    """Return a demonstration carried out again. Raises BadInput where its planes do not cut what they did."""
    done = Demonstration(record.cell, record.families, list(objects), finished=record.finished)
    for number, each in enumerate(record.cuts):
        plane = Plane(np.array(each.plane.normal), each.plane.d)
        try:
            pieces = cut(done.pieces[each.piece], plane, Knife())
        except Refused as refused:
            raise BadInput(f"{where}: cut {number}: {refused.failure.message}", hint="record it again") from None
        if len(pieces) != len(each.shifts):
            raise BadInput(
                f"{where}: cut {number} gives {len(pieces)} pieces, {len(each.shifts)} were recorded",
                hint="record it again",
            )
        done.enter(each.piece, plane, pieces, [np.array(shift) for shift in each.shifts])
    done.categories |= record.categories
    return done


def read_demonstrations(artifact: CuttingDemonstrations, *, only: int | None = None) -> list[Demonstration]:
    """Return the demonstrations of an artifact, or the one trial `only`. Raises BadInput."""
    records = artifact.info.trials
    path: Path = artifact.path("objects.npz")
    bodies = read_bodies(path)
    if len(bodies) != sum(len(record.families) for record in records):
        raise BadInput(f"{path}: {len(bodies)} objects, the trials have others", hint="make the artifact again")
    if only is not None and only >= len(records):
        raise BadInput(
            f"{artifact.root}: has {len(records)} trials, none of number {only}",
            hint=f"give --trial 0 to {len(records) - 1}",
        )
    demonstrations, first = [], 0
    for number, record in enumerate(records):
        objects = bodies[first : first + len(record.families)]
        first += len(objects)
        if only is None or number == only:
            demonstrations.append(replay(record, objects, f"{artifact.root}: trial {number}"))
    return demonstrations
