"""Artifacts for people who write Python: `load(folder)` gives an object with the content, read when it is asked for."""

from stages.engine.loading.artifact import LoadedArtifact
from stages.engine.loading.opening import load, load_run
from stages.engine.loading.perception import (
    LoadedDisparity,
    LoadedEntity,
    LoadedGroundTruth,
    LoadedMap,
    LoadedSegments,
    LoadedSequence,
)
from stages.engine.loading.results import LoadedEvaluation, LoadedExport, LoadedPacking, LoadedPlan, LoadedReport
from stages.engine.loading.scenes import (
    LoadedCadLibrary,
    LoadedCadScene,
    LoadedContactGraph,
    LoadedInteractiveScene,
)
from stages.engine.loading.suture import (
    LoadedSutureEvaluation,
    LoadedSutureNeedle,
    LoadedSutureScene,
    LoadedSutureThread,
    LoadedSutureTrial,
)
from stages.engine.loading.tableware import (
    LoadedTablewareDetections,
    LoadedTablewareEvaluation,
    LoadedTablewarePlan,
    LoadedTablewareScene,
    LoadedTablewareTrial,
)

__all__ = [
    "LoadedArtifact",
    "LoadedCadLibrary",
    "LoadedCadScene",
    "LoadedContactGraph",
    "LoadedEntity",
    "LoadedDisparity",
    "LoadedEvaluation",
    "LoadedExport",
    "LoadedGroundTruth",
    "LoadedInteractiveScene",
    "LoadedMap",
    "LoadedPacking",
    "LoadedPlan",
    "LoadedReport",
    "LoadedSegments",
    "LoadedSequence",
    "LoadedSutureEvaluation",
    "LoadedSutureNeedle",
    "LoadedSutureScene",
    "LoadedSutureThread",
    "LoadedSutureTrial",
    "LoadedTablewareDetections",
    "LoadedTablewareEvaluation",
    "LoadedTablewarePlan",
    "LoadedTablewareScene",
    "LoadedTablewareTrial",
    "load",
    "load_run",
]
