"""`load` and `load_run`."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from schemas.errors import BadInput
from stages.engine.loading.artifact import LoadedArtifact
from stages.engine.loading.perception import (
    LoadedDisparity,
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
from stages.engine.reading import open_artifact
from stages.engine.run_folders import artifacts_of

CLASSES: dict[str, type[LoadedArtifact]] = {
    "cad_library": LoadedCadLibrary,
    "cad_scene": LoadedCadScene,
    "contact_graph": LoadedContactGraph,
    "disparity": LoadedDisparity,
    "evaluation": LoadedEvaluation,
    "exported_sequence": LoadedExport,
    "ground_truth": LoadedGroundTruth,
    "interactive_scene": LoadedInteractiveScene,
    "panoptic_map": LoadedMap,
    "packing": LoadedPacking,
    "plan": LoadedPlan,
    "report": LoadedReport,
    "segments": LoadedSegments,
    "sequence": LoadedSequence,
    "suture_evaluation": LoadedSutureEvaluation,
    "suture_needle": LoadedSutureNeedle,
    "suture_scene": LoadedSutureScene,
    "suture_thread": LoadedSutureThread,
    "suture_trial": LoadedSutureTrial,
    "tableware_detections": LoadedTablewareDetections,
    "tableware_evaluation": LoadedTablewareEvaluation,
    "tableware_plan": LoadedTablewarePlan,
    "tableware_scene": LoadedTablewareScene,
    "tableware_trial": LoadedTablewareTrial,
}
"""Kind -> what it is loaded as; other kinds as LoadedArtifact."""


Loaded = TypeVar("Loaded", bound=LoadedArtifact)


def load(path: Path | str, expected: type[Loaded] = LoadedArtifact) -> Loaded:  # type: ignore[assignment]
    """Open an artifact folder. Kind, version and sizes are checked now, the content is read when it is asked for.

    Raises BadInput when it is no artifact, torn, of another kind than `expected`, or of another schema version (the
    message says how to migrate).
    """
    artifact = open_artifact(Path(path))
    loaded = CLASSES.get(artifact.kind, LoadedArtifact)(artifact)
    if not isinstance(loaded, expected):
        wanted = next((kind for kind, known in CLASSES.items() if known is expected), expected.__name__)
        raise BadInput(f"{path}: holds a {artifact.kind!r} artifact, {wanted!r} is needed", hint="give another folder")
    return loaded


def load_run(path: Path | str) -> dict[str, LoadedArtifact]:
    """Open every artifact of a run folder: step name -> artifact, in the order in which they were made.

    Raises BadInput when there are none, or for the first that cannot be opened.
    """
    found: dict[str, LoadedArtifact] = {name: load(folder) for name, folder in artifacts_of(Path(path)).items()}
    return dict(sorted(found.items(), key=lambda item: (item[1].manifest.provenance.started, item[0])))
