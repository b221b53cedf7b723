"""What cameras see of suture trials: scenes of the states that a trial of ours looks at, which training may use.

A view of a trial differs from one of the needle world (stages/suture/world/scene.py): the ridge is steeper, the thread
leaves the swage as its weight pulls it, drivers have wrists, and the needle is where trials take it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.stages.suture.rig import TWO_CAMERAS
from scenewright.stages.suture.training.network.views import is_kept, keep_view
from scenewright.stages.suture.trials.bench import Bench
from scenewright.stages.suture.trials.machine import run_trial
from scenewright.stages.suture.trials.perception import FOLDER, Eyes, Seen, perception_model
from scenewright.stages.suture.trials.policies import POLICIES
from scenewright.stages.suture.trials.sight import CALIBRATION_ERROR, TrialScene, pictured
from scenewright.stages.suture.world.render import render
from scenewright.stages.suture.world.scene import make_scene

ARMS = ("ours", "thesis")
SEED_OF_CHOICE = 83
"""Seed by which views are chosen from a trial."""
PLACES = ("corner_right", "corner_left", "elsewhere", "tissue")


class Keeping(Eyes):
    """Sees by the error model of ours and keeps the scene of every state that is looked at first, with its place."""

    def __init__(self, seed: int) -> None:
        super().__init__(perception_model(FOLDER / "perception_ours.toml"), np.random.default_rng([seed, 2]))
        self.scenes: list[TrialScene] = []
        self._world = make_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)
        self._bench: Bench | None = None
        self._state = b""

    def watch(self, bench: Bench) -> None:
        """Look at this trial from now on."""
        self._bench = bench

    def look(self, needle: np.ndarray, place: str) -> Seen | None:
        """Return one estimate by the error model; keep what cameras see where it is new."""
        assert self._bench is not None
        state = b"".join(part.tobytes() for part in (needle, *self._bench.tools.values(), self._bench.rope))
        if state != self._state:
            self._state = state
            scene = pictured(self._world, self._bench, needle, len(self.scenes))
            self.scenes.append(replace(scene, place=place))
        return super().look(needle, place)


def trial_scenes(seed: int, arm: str = "ours") -> list[TrialScene]:
    """Return scenes of the arm's trial with this seed: one of each of PLACES that was looked at, drawn by the seed."""
    eyes = Keeping(seed)
    run_trial(POLICIES[arm], seed, eyes=eyes)
    random, chosen = np.random.default_rng([SEED_OF_CHOICE, seed]), []
    for place in PLACES:
        there = [scene for scene in eyes.scenes if scene.place == place]
        if there:
            chosen.append(there[int(random.integers(len(there)))])
    return chosen


def kept_trial(folder: Path, seed: int) -> list[Path]:
    """Return the stems of the views of a trial (the thesis's arm throws those of odd seeds, ours the others); those
    that are not there yet are rendered."""
    scenes = trial_scenes(seed, ARMS[seed % 2])
    stems = [folder / f"trial_{seed:05d}_{scene.place}" for scene in scenes]
    for stem, scene in zip(stems, scenes, strict=True):
        if not is_kept(stem):
            keep_view(stem, render(scene))
    return stems
