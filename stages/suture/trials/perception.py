"""What is seen of the needle: true poses with the errors of a model that a small file states, with its provenance.

An estimate is right, wrong or abstained from. Estimates of a needle that has not moved share most of their error and,
often, their fate: a highlight or a thread in front of the needle does not go away by looking again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from pydantic import Field, ValidationError
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import file_toml
from scenewright.schemas.places import data_file
from scenewright.stages.suture.motion.needle import SWAGE, TIP, from_ends

FOLDER = data_file("stitch")
STILL = 1.5e-3
"""A needle whose ends moved less than this [m] is seen as before."""


class Shares(Model):
    """Shares (0 to 1) by where the needle is: in the corner by who holds it, elsewhere in air, in tissue."""

    corner_left: float = Field(ge=0, le=1)
    corner_right: float = Field(ge=0, le=1)
    elsewhere: float = Field(ge=0, le=1)
    tissue: float = Field(ge=0, le=1)

    def at(self, place: str) -> float:
        """Return the share of a place by its name."""
        return float(getattr(self, place))


class Errors(Model):
    """Standard deviations per axis; `stray_end_share` of the estimates have one end farther off along a direction.
    In `swapped_share` of them tip and swage are taken for each other, and no end strays."""

    normal_degrees: float = Field(ge=0)
    end_millimetres: float = Field(ge=0)
    stray_end_share: float = Field(0.0, ge=0, le=1)
    stray_end_millimetres: float = Field(0.0, ge=0)
    swapped_share: float = Field(0.0, ge=0, le=1)


class PerceptionModel(Model):
    """An error model. `measured` is false while figures are assumed."""

    name: str
    measured: bool
    provenance: str = Field(min_length=20)
    seconds_an_estimate: float = Field(gt=0)
    persistence: float = Field(ge=0, le=1)
    systematic: float = Field(ge=0, le=1)
    thread_length_error: float = Field(ge=0)
    right_share: Shares
    abstained_share: Shares
    right: Errors
    wrong: Errors


def perception_model(path: Path) -> PerceptionModel:
    """Read an error model (TOML). Raises BadInput when the file is not one."""
    hint = "data/stitch/perception_thesis.toml shows one"
    try:
        return PerceptionModel.model_validate(file_toml(path, hint=hint))
    except ValidationError as error:
        raise BadInput(f"{path}: no perception model ({first_problem(error)})", hint=hint) from error


@dataclass(frozen=True)
class Seen:
    """An estimate in the world frame: unit normal (3,), ends (3,) [m]; `right` is known to the simulator alone."""

    normal: np.ndarray
    tip: np.ndarray
    swage: np.ndarray
    right: bool

    @property
    def pose(self) -> np.ndarray:
        """The needle's pose (4, 4) that the estimate amounts to."""
        return from_ends(self.normal, self.tip, self.swage)


def nearer_end(seen: Seen, driver: np.ndarray) -> np.ndarray:
    """Return the end (3,) of a seen needle that is nearer to a driver at (3,)."""
    return min((seen.tip, seen.swage), key=lambda end: float(np.linalg.norm(end - driver)))


def farther_end(seen: Seen, driver: np.ndarray) -> np.ndarray:
    """Return the end (3,) of a seen needle that is farther from a driver at (3,)."""
    return max((seen.tip, seen.swage), key=lambda end: float(np.linalg.norm(end - driver)))


class Looking(Protocol):
    """Who looks at the needle of a trial; `model` says how long an estimate takes and how well thread is seen, the
    others count estimates."""

    model: PerceptionModel
    looks: int
    right: int
    abstained: int

    def look(self, needle: np.ndarray, place: str) -> Seen | None:
        """Return one estimate of a needle at its true pose (4, 4); None when it is abstained from."""
        ...


def ends_of(needle: np.ndarray) -> np.ndarray:
    """Return tip and swage, the columns of (3, 2) [m], of a needle at a pose (4, 4)."""
    return np.asarray(needle[:3, :3] @ np.column_stack([TIP, SWAGE]) + needle[:3, 3:4])


def has_moved(before: np.ndarray | None, ends: np.ndarray) -> bool:
    """Whether ends (3, 2) [m] are farther than STILL from where they were (None: nowhere) at the look before."""
    return before is None or float(np.abs(ends - before).max()) > STILL


class Eyes:
    """Sees needles with the errors of a model; `looks` and `right` count estimates."""

    def __init__(self, model: PerceptionModel, random: np.random.Generator) -> None:
        self.model = model
        self.random = random
        self.looks = self.right = self.abstained = 0
        self._ends: np.ndarray | None = None
        self._fate = "right"
        self._shared = np.zeros((3, 3))
        self._stray = np.zeros((3, 3))

    def look(self, needle: np.ndarray, place: str) -> Seen | None:
        """Return one estimate of a needle at its true pose (4, 4); None when it is abstained from."""
        ends = ends_of(needle)
        if has_moved(self._ends, ends) or self.random.random() > self.model.persistence:
            self._draw(place)
        self._ends = ends
        self.looks += 1
        if self._fate == "abstained":
            self.abstained += 1
            return None
        self.right += self._fate == "right"
        errors = self.model.right if self._fate == "right" else self.model.wrong
        shared = self.model.systematic
        draw = np.sqrt(shared) * self._shared + np.sqrt(1.0 - shared) * self.random.standard_normal((3, 3))
        normal = needle[:3, 2] + np.tan(np.radians(errors.normal_degrees)) * draw[0]
        offsets = draw[1:] * errors.end_millimetres / 1000.0 + self._stray[1:]
        tip, swage = ends[:, 0] + offsets[0], ends[:, 1] + offsets[1]
        normal /= np.linalg.norm(normal)
        if self._fate == "swapped":
            return Seen(-normal, swage, tip, False)
        return Seen(normal, tip, swage, self._fate == "right")

    def _draw(self, place: str) -> None:
        random, model = self.random, self.model
        self._shared = random.standard_normal((3, 3))
        self._stray = np.zeros((3, 3))
        if random.random() < model.right_share.at(place):
            self._fate = "right"
            return
        self._fate = "abstained" if random.random() < model.abstained_share.at(place) else "wrong"
        swaps = model.wrong.swapped_share if self._fate == "wrong" else 0.0
        if swaps and random.random() < swaps:
            self._fate = "swapped"
        elif random.random() < model.wrong.stray_end_share:
            direction = random.standard_normal(3)
            row = int(random.integers(1, 3))
            self._stray[row] = direction / np.linalg.norm(direction) * model.wrong.stray_end_millimetres / 1000.0
