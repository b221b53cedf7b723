"""What a person cut, in a file that is written after every cut: whoever stops, at whatever moment, loses nothing."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path

import numpy as np
from scenewright.schemas.cutting_demonstrations import CategoryName, CuttingRecording, RecordedTrial
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.demonstrations.records import record_of, replay
from scenewright.stages.cutting.recording.panels import NoCut, Panels, panels
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.foods import FAMILIES, make_food
from scenewright.stages.cutting.world.knife import Knife, Refused, cut
from scenewright.stages.kit.geometry.transforms import transform_from

GAP = 0.008
"""Distance by which what was cut is pushed apart [m]; by eye."""
CELL = "n1m1"
"""Cell of the thesis's table: one object, one category."""
HINT = "give a file that scenewright cutting record FILE wrote"
LYING = transform_from(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), np.zeros(3))
"""Spine along x, shortest edge up."""
LARGEST = 16 * 2**20
"""Bytes of a recording."""


def object_of(food: str, seed: int) -> Body:
    """Return what is cut in a trial. Raises BadInput for no food."""
    if food not in FAMILIES:
        raise BadInput(f"there is no food {food!r:.40}", hint=f"choose one of {', '.join(FAMILIES)}")
    return make_food(food, np.random.default_rng(seed)).moved(LYING)


def read_recording(path: Path) -> tuple[list[RecordedTrial], list[Demonstration]]:
    """Return the trials of a recording, also carried out again. Raises BadInput."""
    trials = list(CuttingRecording.read(path, largest=LARGEST, hint=HINT).trials)
    done = []
    for number, recorded in enumerate(trials):
        if recorded.trial.families != (recorded.food,):
            raise BadInput(f"{path}: trial {number} is of {recorded.food} and of another thing", hint=HINT)
        done.append(replay(recorded.trial, [object_of(recorded.food, recorded.seed)], f"{path}: trial {number}"))
    return trials, done


class Session:
    """Trials of one food after the other, from seeds in a row."""

    def __init__(self, path: Path, food: str, seed: int) -> None:
        self._path, self._food = path, food
        self._before = read_recording(path)[0] if path.exists() else []
        self._seed = seed + len(self._before)
        self._begin()

    def _begin(self) -> None:
        self.trial = Demonstration(CELL, (self._food,), [object_of(self._food, self._seed)], finished=False)
        self.__dict__.pop("shown", None)

    @property
    def trials(self) -> int:
        """How many are in the file beside the one that is being cut."""
        return len(self._before)

    @cached_property
    def shown(self) -> Panels:
        """The pieces that lie there."""
        return panels({number: self.trial.pieces[number] for number in self.trial.final})

    def cut(self, points: np.ndarray) -> str:
        """Cut where two clicks (2, 2) [px] say; return what came of it. Raises NoCut, also for what no knife does."""
        piece, plane = self.shown.plane(points)
        try:
            bodies = cut(self.trial.pieces[piece], plane, Knife())
        except Refused as refused:
            raise NoCut(refused.failure.message) from None
        numbers = self.trial.do(piece, plane, bodies, GAP)
        self._save()
        return f"piece {piece} became {', '.join(map(str, numbers))}"

    def undo(self) -> str:
        """Take the last cut back. Raises NoCut where there is none."""
        if not self.trial.cuts:
            raise NoCut("nothing was cut yet")
        last = self.trial.cuts.pop()
        del self.trial.pieces[-len(last.results) :]
        self._save()
        return f"piece {last.piece} is whole again"

    def finish(self, category: CategoryName | None) -> str:
        """Say what the fragments are called, None for a trial that stops midway, and begin another. Raises NoCut."""
        if not self.trial.cuts:
            raise NoCut("nothing was cut yet")
        self.trial.finished = category is not None
        self.trial.categories = {} if category is None else dict.fromkeys(self.trial.final, category)
        self._save()
        self._before.append(self._recorded_trial())
        message = f"kept: {len(self.trial.final)} {category or 'fragments, not finished'}"
        self._seed += 1
        self._begin()
        return message

    def _recorded_trial(self) -> RecordedTrial:
        return RecordedTrial(food=self._food, seed=self._seed, trial=record_of(self.trial, training=True))

    def _save(self) -> None:
        self.__dict__.pop("shown", None)
        begun = [self._recorded_trial()] if self.trial.cuts else []
        partial = self._path.with_name(f".{self._path.name}.partial")
        CuttingRecording(trials=(*self._before, *begun)).write(partial)
        os.replace(partial, self._path)
