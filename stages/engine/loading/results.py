"""Plans, packings, evaluations, reports and exports."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from schemas.evaluation import MetricsFile
from schemas.exported_sequence import ExportFile
from schemas.packing import PackingAttempt, PackingFile, PackingInstanceFile
from schemas.plan import Failure, PlanFile, PlannedAction
from stages.engine.loading.artifact import LoadedArtifact
from stages.kit.formats.numpy_files import read_arrays

TRAJECTORY_ARRAYS = ("time", "joints", "world_from_base", "action")
PACKING_ARRAYS = ("joints", "action")


class LoadedPlan(LoadedArtifact):
    """Kind `plan`."""

    @cached_property
    def info(self) -> PlanFile:
        """plan.json."""
        return PlanFile.read(self.path / "plan.json")

    @property
    def status(self) -> str:
        """`executed`, `planned`, `infeasible` or `execution_failed`."""
        return self.info.status

    @property
    def actions(self) -> tuple[PlannedAction, ...]:
        """The steps of the plan, with their rows of `trajectory`."""
        return self.info.actions

    @property
    def failures(self) -> tuple[Failure, ...]:
        """What failed on the way, with names and numbers; the last ended the search when there is no plan."""
        return self.info.failures

    @cached_property
    def trajectory(self) -> dict[str, np.ndarray]:
        """`time` (N,) [s], `joints` (N, 9) [rad, m], `world_from_base` (N, 4, 4), `action` (N,); empty without a
        plan."""
        if "trajectory.npz" not in self.files:
            return {}
        arrays = read_arrays(self.path / "trajectory.npz", *TRAJECTORY_ARRAYS)
        return dict(zip(TRAJECTORY_ARRAYS, arrays, strict=True))


class LoadedPacking(LoadedArtifact):
    """Kind `packing`."""

    @cached_property
    def info(self) -> PackingFile:
        """packing.json."""
        return PackingFile.read(self.path / "packing.json")

    @cached_property
    def problem(self) -> PackingInstanceFile:
        """instance.json: boxes, basket, obstacles."""
        return PackingInstanceFile.read(self.path / "instance.json")

    @property
    def success(self) -> bool:
        """Whether every box ended in the basket."""
        return self.info.success

    @property
    def attempts(self) -> tuple[PackingAttempt, ...]:
        """Every proposed plan with what motion planning said to it."""
        return self.info.attempts

    @cached_property
    def trajectory(self) -> dict[str, np.ndarray]:
        """`joints` (N, 7) [rad], `action` (N,) row of the last plan; empty without one."""
        if "trajectory.npz" not in self.files:
            return {}
        arrays = read_arrays(self.path / "trajectory.npz", *PACKING_ARRAYS)
        return dict(zip(PACKING_ARRAYS, arrays, strict=True))


class LoadedEvaluation(LoadedArtifact):
    """Kind `evaluation`."""

    @cached_property
    def info(self) -> MetricsFile:
        """metrics.json."""
        return MetricsFile.read(self.path / "metrics.json")

    @property
    def metrics(self) -> dict[str, float | None]:
        """`<part>/<measure>` -> number; None where it is undefined."""
        return dict(self.info.metrics)

    @property
    def label(self) -> str:
        """What the figures are about; to print beside every one of them."""
        return self.info.label


class LoadedReport(LoadedArtifact):
    """Kind `report`."""

    @property
    def html_path(self) -> Path:
        """The page, self-contained."""
        return self.path / "report.html"


class LoadedExport(LoadedArtifact):
    """Kind `exported_sequence`."""

    @cached_property
    def info(self) -> ExportFile:
        """export.json."""
        return ExportFile.read(self.path / "export.json")

    @property
    def log(self) -> Path:
        """What other tools, or `scenewright ingest`, open."""
        return (self.path / self.info.log).resolve()
