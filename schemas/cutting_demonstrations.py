"""Kind `cutting_demonstrations`: how things were cut, plane by plane; lengths in metres, world frame."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Name, Seed, Vector3

CategoryName = Literal["chunks", "slices", "strips", "cubes"]
PieceNumber = Annotated[int, Field(ge=0, lt=4096)]


class CuttingPlane(Model):
    """n . x + d = 0 (Han 2024, section 6.3), n of length 1."""

    normal: Vector3
    d: float

    @model_validator(mode="after")
    def _normal_is_unit(self) -> CuttingPlane:
        if abs(sum(v * v for v in self.normal) - 1.0) > 1e-6:
            raise ValueError("the normal of a plane has not length 1")
        return self


class DemonstratedCut(Model):
    """A cut of one piece. Results are numbered on from the pieces before, the plane's positive side first."""

    piece: PieceNumber
    plane: CuttingPlane
    shifts: tuple[Vector3, ...] = Field(min_length=2, max_length=64)
    """How far each result was pushed aside."""


class DemonstrationRecord(Model):
    """One trial: objects first, then what cuts made of them, all by number."""

    cell: Literal["n1m1", "n1m2", "n2m1", "n2m2", "n2m3", "n3m4"]
    families: tuple[Name, ...] = Field(min_length=1, max_length=3)
    cuts: tuple[DemonstratedCut, ...] = Field(max_length=256)
    categories: dict[PieceNumber, CategoryName]
    """What the fragments are called that were left in the end."""
    finished: bool
    """False: whoever cut stopped midway; what was left is no goal."""
    training: bool

    @model_validator(mode="after")
    def _cuts_are_of_pieces_that_lie_there(self) -> DemonstrationRecord:
        pieces_there = set(range(len(self.families)))
        pieces = len(pieces_there)
        for number, cut in enumerate(self.cuts):
            if cut.piece not in pieces_there:
                raise ValueError(f"cut {number} is of piece {cut.piece}, which does not lie there")
            pieces_there.remove(cut.piece)
            pieces_there |= set(range(pieces, pieces + len(cut.shifts)))
            pieces += len(cut.shifts)
        if not set(self.categories) <= pieces_there:
            raise ValueError("a category names a piece that is not left in the end")
        return self


class CuttingDemonstrationsFile(Model):
    """demonstrations.json."""

    seed: Seed
    tilt: float | None
    spacing: float | None
    """How far the scripted cutter misses; None where a person cut."""
    trials: tuple[DemonstrationRecord, ...] = Field(min_length=1, max_length=2000)
    statement: str


class RecordedTrial(Model):
    """A trial that a person cut; the object is the food of this name made from this seed."""

    food: Name
    seed: Seed
    trial: DemonstrationRecord


class CuttingRecording(Model):
    """What `cutting record` writes after every cut, and `cutting demonstrate --record` reads."""

    trials: tuple[RecordedTrial, ...] = Field(max_length=2000)


class CuttingDemonstrations(Artifact):
    """`demonstrations.json`, `objects.npz` (the objects of all trials, in order), `sheet.png` (some trials before and
    after)."""

    kind: ClassVar[str] = "cutting_demonstrations"
    description: ClassVar[str] = "demonstrations of cutting"
    info = Document(CuttingDemonstrationsFile, "demonstrations.json")
