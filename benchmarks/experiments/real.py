"""The whole chain with the detector backend on real logs, and a check against what anyone sees in them.

Runs the pipeline `reconstruct` for every log of benchmarks/expectations/real.toml into the output folder. Exits with 4
when an expectation does not hold, with the step's own code when a chain stops.
"""

from __future__ import annotations

import sys
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.engine.chain import run_pipeline
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Results, Trial
from benchmarks.steps import StepFailed, opened

EXPECTATIONS = Path(__file__).resolve().parents[1] / "expectations" / "real.toml"
EXPECTED: dict[str, dict[str, Any]] = tomllib.loads(EXPECTATIONS.read_text(encoding="utf-8"))
MAXIMUM_FLOOR_HEIGHT = 0.03
"""Root mean square height over z = 0 of the floor's upward-facing vertices that still counts as flat [m]."""
MINIMUM_FLOOR_SHARE = 0.7
"""Share of all vertices labelled floor that lie within 3 cm of z = 0 (the rest is mislabelled wall and furniture)."""


class RealParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    weights: Path | None = Field(None, description="ONNX detector instead of DATA/detectors/yolox_nano.onnx")


SCENE_FACTS = ("cad_models", "bodies", "movable", "joints", "unstable", "largest_move_mm", "max_penetration_mm")
"""What `urdf` says of the interactive scene."""


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Run the chain of every log and yield what is found in its artifacts. Raises StepFailed."""
    data: Path = bench.parameters.data
    weights = bench.parameters.weights or data / "detectors" / "yolox_nano.onnx"
    pipeline = read_pipeline(pipeline_path("reconstruct"))
    for trial in trials:
        expected = EXPECTED[trial.case]
        log = str(expected["log"])
        path = bench.out / log[1:] if log.startswith("@") else data / log
        settings = {"log": str(path), "backend": "detector", "weights": str(weights), "every": str(expected["every"])}
        settings |= expected.get("settings", {})
        run = bench.out / trial.case
        reports = run_pipeline(pipeline, run, settings, announce=lambda text: print(text, file=sys.stderr))
        if reports[-1].exit_code != 0:
            raise StepFailed(f"{trial.case}: {reports[-1].name}", reports[-1].exit_code)
        yield trial, facts_of_run(run)


def floor_facts(panoptic_map: PanopticMap, camera_heights: np.ndarray) -> dict[str, float]:
    """Height statistics of the floor entities and of the cameras above them [m]."""
    floors = [entity for entity in panoptic_map.info.entities if entity.class_name == "floor"]
    if not floors:
        return {}
    meshes = [trimesh.load_mesh(panoptic_map.path(entity.mesh), process=False) for entity in floors]
    heights = np.concatenate([mesh.vertices[:, 2] for mesh in meshes])
    upward = np.concatenate([mesh.vertex_normals[:, 2] for mesh in meshes]) > 0.8
    normals = np.concatenate([mesh.face_normals * mesh.area_faces[:, None] for mesh in meshes]).sum(axis=0)
    return {
        "floor_height_rms": float(np.sqrt(np.mean(heights[upward] ** 2))),
        "floor_height_median": float(np.median(heights)),
        "floor_share_within_3cm": float(np.mean(np.abs(heights) < 0.03)),
        "floor_normal_z": float(normals[2] / np.linalg.norm(normals)),
        "camera_height_median": float(np.median(camera_heights)),
    }


def facts_of_run(run: Path) -> dict[str, Any]:
    """Collect what the table shows from the artifacts of one run."""
    sequence = opened(SequenceArtifact, run / "sequence")
    panoptic_map, graph = opened(PanopticMap, run / "panoptic_map"), opened(ContactGraph, run / "contact_graph")
    classes = {node.id: node.class_name for node in graph.info.nodes}
    supports = Counter(
        f"{classes[link.source]} > {classes[link.target]}"
        for link in graph.info.links
        if link.relation in TREE_RELATIONS and link.source != "scene"
    )
    scene = read_manifest(run / "interactive_scene").summary
    steps = {}
    for folder in sorted(run.iterdir()):
        if (folder / "manifest.json").exists():
            manifest = read_manifest(folder)
            steps[folder.name] = {
                "seconds": manifest.provenance.seconds,
                "peak_mib": manifest.provenance.peak_memory_bytes / 2**20,
            }
    trajectory = np.loadtxt(sequence.path("trajectory.tum"), ndmin=2)
    chain = [name for name in steps if name not in ("cad_library", "evaluation", "report")]
    seconds = sum(steps[name]["seconds"] for name in chain)
    return {
        "frames_in_log": sequence.info.frames_in_log,
        "frames_used": sequence.info.frame_count,
        "drops": sequence.info.drops,
        "frames_per_second": sequence.info.frame_count / seconds,
        "entities": dict(Counter(entity.class_name for entity in panoptic_map.info.entities).most_common()),
        "supports": dict(supports.most_common()),
        "gravity": sequence.info.gravity.method,
        "steps": steps,
        **{f"scene_{name}": float(value) for name in SCENE_FACTS if isinstance(value := scene.get(name), int | float)},
        **floor_facts(panoptic_map, trajectory[:, 3]),
    }


def unmet(expected: dict[str, Any], facts: dict[str, Any]) -> list[str]:
    """Return the expectations that do not hold, in words."""
    problems = []
    for group, found in (("entities", facts["entities"]), ("supported", facts["supports"])):
        for name, least in expected[group].items():
            if found.get(name, 0) < least:
                problems.append(f"{name}: {found.get(name, 0)} found, at least {least} can be seen")
    if facts.get("floor_height_rms", np.inf) > MAXIMUM_FLOOR_HEIGHT:
        problems.append(f"floor: not flat at z = 0 (rms {facts.get('floor_height_rms', np.nan):.3f} m)")
    if facts.get("floor_share_within_3cm", 0.0) < MINIMUM_FLOOR_SHARE:
        problems.append(f"floor: only {facts.get('floor_share_within_3cm', 0.0):.0%} of it within 3 cm of z = 0")
    if facts.get("floor_normal_z", -1.0) < 0.9 or facts.get("camera_height_median", 0.0) < 0.3:
        problems.append("up is not up")
    return problems


def problems(results: Results) -> list[str]:
    """Return the expectations that do not hold in any log."""
    return [
        f"{t.case}: {problem}" for t, facts in results.records.items() for problem in unmet(EXPECTED[t.case], facts)
    ]


def more_figures(results: Results) -> dict[str, float | None]:
    """Every number of every log."""
    metrics: dict[str, float | None] = {}
    for trial, facts in results.records.items():
        key = f"{trial.arm}/{trial.case}"
        metrics |= {f"{key}/{name}": v for name, v in facts.items() if isinstance(v, int | float)}
        for group in ("entities", "supports", "drops"):
            metrics |= {f"{key}/{group}_{name}": value for name, value in facts[group].items()}
        for step, cost in facts["steps"].items():
            metrics |= {f"{key}/{step}_{name}": value for name, value in cost.items()}
    return metrics


EXPERIMENT = Experiment(
    name="real",
    title="The chain on real logs",
    simulated="Nothing, but the living room's images are rendered.",
    knows="Colour, depth, camera, the poses that the logs bring; masks of a detector trained on photographs (COCO), "
    "whose thresholds were set on these logs.",
    does_not_show="Accuracy: nobody measured these rooms. That the chain works on a log it has never seen. What is "
    "expected are lower bounds, what the pictures show at least, so that finding a chair too many passes; of the "
    "office two chairs are asked for and none is found. Names may be false: the kitchen's microwave and sink are "
    "wooden models. The five frames of the dining room show most of its chairs once, in pieces that nothing joins. "
    "Times were taken on a busy machine.",
    arms={"ours": "ours"},
    cases=tuple(EXPECTED),
    seeds_of=lambda bench, case: [case],
    measure=measure,
    record=dict[str, Any],
    measures={},
    more_figures=more_figures,
    parameters=RealParameters,
    keeps=False,
    problems=problems,
)
