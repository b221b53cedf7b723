"""Tables of tableware: scenes, what was seen, plans, trials, comparisons."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from schemas.tableware_detections import TablewareDetection, TablewareDetectionsFile
from schemas.tableware_plan import TablewarePlanFile, TablewareStep
from schemas.tableware_scene import TablewareItem, TablewareSceneFile
from schemas.tableware_trial import EvaluatedPolicy, TablewareEvaluationFile, TablewareTrialFile, TrialStep
from stages.engine.loading.artifact import LoadedArtifact
from stages.kit.formats.numpy_files import read_arrays


class LoadedTablewareScene(LoadedArtifact):
    """Kind `tableware_scene`."""

    @cached_property
    def info(self) -> TablewareSceneFile:
        """scene.json."""
        return TablewareSceneFile.read(self.path / "scene.json")

    @property
    def items(self) -> tuple[TablewareItem, ...]:
        """What stands on the table: the truth."""
        return self.info.items

    @cached_property
    def depth(self) -> np.ndarray:
        """(H, W) float32 [m]."""
        return read_arrays(self.path / "depth.npz", "depth")[0]


class LoadedTablewareDetections(LoadedArtifact):
    """Kind `tableware_detections`."""

    @cached_property
    def info(self) -> TablewareDetectionsFile:
        """detections.json."""
        return TablewareDetectionsFile.read(self.path / "detections.json")

    @property
    def items(self) -> tuple[TablewareDetection, ...]:
        """What was seen, with confidences and doubts."""
        return self.info.items


class LoadedTablewarePlan(LoadedArtifact):
    """Kind `tableware_plan`."""

    @cached_property
    def info(self) -> TablewarePlanFile:
        """plan.json."""
        return TablewarePlanFile.read(self.path / "plan.json")

    @property
    def steps(self) -> tuple[TablewareStep, ...]:
        """The actions, with the table before each."""
        return self.info.steps


class LoadedTablewareTrial(LoadedArtifact):
    """Kind `tableware_trial`."""

    @cached_property
    def info(self) -> TablewareTrialFile:
        """trial.json."""
        return TablewareTrialFile.read(self.path / "trial.json")

    @property
    def steps(self) -> tuple[TrialStep, ...]:
        """What was done and what came of it."""
        return self.info.steps


class LoadedTablewareEvaluation(LoadedArtifact):
    """Kind `tableware_evaluation`."""

    @cached_property
    def info(self) -> TablewareEvaluationFile:
        """results.json."""
        return TablewareEvaluationFile.read(self.path / "results.json")

    @property
    def rows(self) -> tuple[EvaluatedPolicy, ...]:
        """Figures of each policy and tier."""
        return self.info.rows
