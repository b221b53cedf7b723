"""Suturing: rendered scenes, needle poses, threads, trials, figures."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from schemas.evaluation import MetricsFile
from schemas.suture_needle import NeedleFrame, SutureNeedleFile, SutureThreadFile
from schemas.suture_scene import SutureSceneFile, SutureView
from schemas.suture_trial import SutureRun, SutureTrialFile
from stages.engine.loading.artifact import LoadedArtifact
from stages.engine.loading.perception import LoadedSequence
from stages.kit.formats.numpy_files import read_arrays

FRAMES = ("panel", "suture", "seconds", "world_from_tool", "world_from_needle", "thread")
MOTIONS = ("seconds", "arm", "world_from_tool", "world_from_needle", "joints")


class LoadedSutureScene(LoadedSequence):
    """Kind `suture_scene`: a sequence with the truth about it."""

    @cached_property
    def truth(self) -> SutureSceneFile:
        """scene.json."""
        return SutureSceneFile.read(self.path / "scene.json")

    @property
    def views(self) -> tuple[SutureView, ...]:
        """The truth of each frame."""
        return self.truth.views

    def thread(self, frame: int) -> np.ndarray:
        """Return a frame's true thread (N, 3) [m], left camera's frame, from the swage on."""
        return read_arrays(self.path / "threads.npz", f"thread_{frame:06d}")[0]


class LoadedSutureNeedle(LoadedArtifact):
    """Kind `suture_needle`."""

    @cached_property
    def info(self) -> SutureNeedleFile:
        """needle.json."""
        return SutureNeedleFile.read(self.path / "needle.json")

    @property
    def frames(self) -> tuple[NeedleFrame, ...]:
        """What was made of each frame."""
        return self.info.frames


class LoadedSutureThread(LoadedArtifact):
    """Kind `suture_thread`."""

    @cached_property
    def info(self) -> SutureThreadFile:
        """thread.json."""
        return SutureThreadFile.read(self.path / "thread.json")

    def points(self, frame: int) -> np.ndarray:
        """Return a frame's curve (N, 3) [m], left camera's frame; none where the thread was not traced."""
        if not next((one.points for one in self.info.frames if one.frame == frame), 0):
            return np.zeros((0, 3))
        return read_arrays(self.path / "threads.npz", f"points_{frame:06d}")[0]


class LoadedSutureTrial(LoadedArtifact):
    """Kind `suture_trial`."""

    @cached_property
    def info(self) -> SutureTrialFile:
        """trial.json."""
        return SutureTrialFile.read(self.path / "trial.json")

    @property
    def runs(self) -> tuple[SutureRun, ...]:
        """What every trial came to."""
        return self.info.runs

    @cached_property
    def frames(self) -> dict[str, np.ndarray]:
        """Key frames of the recorded trial (schemas/suture_trial.py)."""
        return dict(zip(FRAMES, read_arrays(self.path / "frames.npz", *FRAMES), strict=True))

    @cached_property
    def motions(self) -> dict[str, np.ndarray]:
        """Motions of the recorded trial (schemas/suture_trial.py)."""
        return dict(zip(MOTIONS, read_arrays(self.path / "motions.npz", *MOTIONS), strict=True))


class LoadedSutureEvaluation(LoadedArtifact):
    """Kind `suture_evaluation`."""

    @cached_property
    def metrics(self) -> MetricsFile:
        """metrics.json."""
        return MetricsFile.read(self.path / "metrics.json")
