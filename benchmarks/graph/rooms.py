"""Generated rooms for the graph's experiments, and how a graph is judged against their truth."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from schemas.contact_graph import ContactGraphFile
from schemas.ground_truth import GroundTruth
from stages.engine.chain import run_command
from stages.engine.reading import open_artifact
from stages.evaluate.graph_measures import GraphComparison, compare_graphs, optional_nodes
from stages.evaluate.parameters import EvaluateParameters
from stages.evaluate.truth import TrueRoom, load_truth
from stages.kit.measurement.edge_agreement import BESIDE_THE_TREE, DIRECTED, EdgeAgreement, edge_agreement
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context

OPTIONS = EvaluateParameters.model_validate({})
RELATIONS = (*DIRECTED, *BESIDE_THE_TREE)
Figures = dict[str, float | None]


def made(arguments: list[str], out: Path) -> Path:
    """Run a scenewright command that writes `out` (nothing happens when it is up to date)."""
    code, _ = run_command([*arguments, "--out", str(out), "--quiet"])
    if code != 0:
        sys.exit(f"{' '.join(arguments)} exited with {code}")
    return out


def generated_room(folder: Path, recipe: str, seed: int, frames: int, size: tuple[int, int]) -> Path:
    """Return the ground truth of a room, made below `folder` with a library of its own where it is not there yet."""
    library = made(["library", "build", "--seed", "1"], folder / "cad_library")
    options = ["--frames", str(frames), "--width", str(size[0]), "--height", str(size[1])]
    command = ["synthesize", "--library", str(library), "--recipe", recipe, "--seed", str(seed), *options]
    return made(command, folder / f"{recipe}-{seed}-{frames}" / "ground_truth")


def read_room(path: Path, world_from_log: np.ndarray | None = None) -> TrueRoom:
    """Return what is true of a room, in the log's world or another one."""
    truth = open_artifact(path, GroundTruth)
    assert isinstance(truth, GroundTruth)
    pose = np.eye(4) if world_from_log is None else world_from_log
    return load_truth(truth, pose, OPTIONS.minimum_visible_points)


def judge(
    room: TrueRoom, graph: ContactGraphFile, overlaps: Mapping[tuple[int, int], float]
) -> tuple[GraphComparison, dict[str, EdgeAgreement]]:
    """Return the edit distance with its parts, and the counts of the edges by relation. `overlaps`: IoU of the visible
    points by (true, predicted) instance."""
    comparison = compare_graphs(room, graph, overlaps, OPTIONS.node_match_iou)
    ignored = optional_nodes(room, comparison.true)
    pairs = dict(comparison.distance.pairs)
    return comparison, edge_agreement(comparison.true, comparison.predicted, pairs, ignored=ignored)


def distance_figures(comparison: GraphComparison) -> Figures:
    """Return the edit distance and its parts, as metrics.json names them."""
    distance = comparison.distance
    return {
        "edit_distance": distance.total,
        "edit_distance_exact": float(distance.exact),
        "wrong_support": len(distance.wrong_supports),
        "missing_detection": len(distance.missing),
        "wrong_detection": distance.wrong_detections,
    }


def context_in(folder: Path) -> Context:
    """A context that writes into `folder`, seed 0, and says nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    return Context(output=folder, seed=0, device="cpu", progress=SilentProgress())


def write_figures(out: Path, figures: Mapping[str, float | None], table: str) -> None:
    """Write metrics.json (flat, with where and on which commit) and table.md."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    about = {"commit": commit.stdout.strip(), "machine": platform.machine(), "python": platform.python_version()}
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"about": about, "metrics": dict(figures)}, indent=1, sort_keys=True)
    (out / "metrics.json").write_text(text + "\n", encoding="utf-8")
    (out / "table.md").write_text(table + "\n", encoding="utf-8")
