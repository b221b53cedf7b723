"""The case `real`: maps of `make real`, contact graphs scored against the annotations, scenes let go in physics."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.scene.arms import REAL, Arm
from benchmarks.scene.experiment import (
    Outcome,
    context_in,
    measure_graph,
    overlaps_of,
    physics_of,
    settle,
    what_moved,
)
from schemas.cad_library import CadLibrary
from schemas.ground_truth import GroundTruth
from schemas.panoptic_map import PanopticMap
from stages.cad.stage import run as replace_objects
from stages.engine.reading import open_artifact
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.truth import load_truth
from stages.graph.stage import run as build_graph

ANNOTATIONS = Path(__file__).resolve().parents[2] / "data" / "annotations" / "real"


def annotated_runs(real: Path) -> list[Path]:
    """Return the annotations of the logs whose map stands under `real` (`make real`), by name."""
    found = sorted(ANNOTATIONS.glob("*.json"))
    return [file for file in found if (real / file.stem / "panoptic_map" / "manifest.json").is_file()]


def run_real(real: Path, scratch: Path, arms: Sequence[Arm], seed: int) -> list[Outcome]:
    """Return the outcomes of every arm for every log of `annotated_runs`.

    All arms start from the one map that is there. No CAD model is true, so that only graph and physics are measured.
    Raises BadInput when sequence, map or library of a run are broken.
    """
    outcomes = []
    for annotation in annotated_runs(real):
        folder, where = real / annotation.stem, scratch / annotation.stem
        command = [sys.executable, "-m", "cli", "truth", "supports", "--annotation", str(annotation)]
        command += ["--sequence", str(folder / "sequence"), "--panoptic-map", str(folder / "panoptic_map")]
        subprocess.run([*command, "--out", str(where / "ground_truth")], check=True, stdout=subprocess.DEVNULL)
        truth_artifact = open_artifact(where / "ground_truth", GroundTruth)
        panoptic_map = open_artifact(folder / "panoptic_map", PanopticMap)
        library = open_artifact(folder / "cad_library", CadLibrary)
        assert isinstance(truth_artifact, GroundTruth) and isinstance(panoptic_map, PanopticMap)
        assert isinstance(library, CadLibrary)
        truth = load_truth(truth_artifact, np.eye(4), EvaluateParameters().minimum_visible_points)
        overlaps = overlaps_of(truth, panoptic_map)
        for arm in arms:
            # `cad` takes every mesh that it finds in its folder for a thing of the scene, those of an earlier run too.
            shutil.rmtree(where / arm.name, ignore_errors=True)
            graph = build_graph(
                panoptic_map, parameters=arm.graph, context=context_in(where / arm.name / "graph", seed)
            )
            context = context_in(where / arm.name / "cad_scene", seed)
            scene = replace_objects(graph, panoptic_map, library, parameters=arm.cad, context=context)
            settled = settle(scene, where / arm.name / "interactive_scene", seed)
            distance, edges = measure_graph(truth, graph.info, overlaps)
            outcomes.append(
                Outcome(
                    room=annotation.stem,
                    arm=arm.name,
                    case=REAL,
                    graph=distance,
                    edges=edges,
                    physics=physics_of(settled),
                    unsettled=what_moved(settled),
                )
            )
    return outcomes
