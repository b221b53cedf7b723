"""`make real`: the whole chain with the detector backend on real logs, one table, and a check against what anyone sees.

Runs the pipeline `reconstruct` for every log of benchmarks/expectations/real.toml and writes metrics.json and table.md.
Exits with 4 when an expectation does not hold, with the step's own code when a chain stops.
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from schemas.contact_graph import ContactGraph
from schemas.panoptic_map import PanopticMap
from schemas.scene_parts import TREE_RELATIONS
from schemas.sequence import Sequence
from stages.engine.chain import run_pipeline
from stages.engine.pipelines import pipeline_path, read_pipeline
from stages.engine.reading import open_artifact

EXPECTATIONS = Path(__file__).resolve().parent.parent / "expectations" / "real.toml"
MAXIMUM_FLOOR_HEIGHT = 0.03
"""Root mean square height over z = 0 of the floor's upward-facing vertices that still counts as flat [m]."""
MINIMUM_FLOOR_SHARE = 0.7
"""Share of all vertices labelled floor that lie within 3 cm of z = 0 (the rest is mislabelled wall and furniture)."""


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
    sequence = open_artifact(run / "sequence", Sequence)
    panoptic_map = open_artifact(run / "panoptic_map", PanopticMap)
    graph = open_artifact(run / "contact_graph", ContactGraph)
    assert isinstance(sequence, Sequence) and isinstance(panoptic_map, PanopticMap) and isinstance(graph, ContactGraph)
    classes = {node.id: node.class_name for node in graph.info.nodes}
    supports = Counter(
        f"{classes[link.source]} > {classes[link.target]}"
        for link in graph.info.links
        if link.relation in TREE_RELATIONS and link.source != "scene"
    )
    steps = {}
    for folder in sorted(run.iterdir()):
        if (folder / "manifest.json").exists():
            manifest = open_artifact(folder).manifest
            assert manifest is not None
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


def table(rows: dict[str, dict[str, Any]]) -> str:
    """Return the Markdown table."""
    header = "| log | frames used / in log | dropped | frames/s | entities | support edges | floor rms [mm] |"
    lines = [header, "|" + "---|" * 7]
    for name, facts in rows.items():
        entities = ", ".join(f"{count} {cls}" for cls, count in facts["entities"].items())
        supports = ", ".join(f"{edge} {count}" for edge, count in facts["supports"].items())
        drops = ", ".join(f"{reason} {count}" for reason, count in facts["drops"].items()) or "0"
        rms = "no floor"
        if "floor_height_rms" in facts:
            rms = f"{1000 * facts['floor_height_rms']:.1f} ({facts['floor_share_within_3cm']:.0%})"
        lines.append(
            f"| {name} | {facts['frames_used']} / {facts['frames_in_log']} | {drops} | "
            f"{facts['frames_per_second']:.2f} | {entities} | {supports} | {rms} |"
        )
    steps = list(dict.fromkeys(step for facts in rows.values() for step in facts["steps"]))
    lines += [
        "",
        "Seconds (peak MiB) per step:",
        "",
        "| log | " + " | ".join(steps) + " |",
        "|" + "---|" * (len(steps) + 1),
    ]
    for name, facts in rows.items():
        cells = [facts["steps"].get(step) for step in steps]
        texts = [f"{c['seconds']:.1f} ({c['peak_mib']:.0f})" if c else "" for c in cells]
        lines.append(f"| {name} | " + " | ".join(texts) + " |")
    lines += [
        "",
        "Floor rms: height over z = 0 of its upward vertices; in brackets the share of all its vertices within 3 cm.",
    ]
    return "\n".join(lines) + "\n"


def flat_metrics(rows: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Return `ours/<log>/<measure>` -> number."""
    metrics: dict[str, float] = {}
    for name, facts in rows.items():
        for measure, value in facts.items():
            if isinstance(value, int | float):
                metrics[f"ours/{name}/{measure}"] = value
        for group in ("entities", "supports", "drops"):
            metrics.update({f"ours/{name}/{group}_{key}": value for key, value in facts[group].items()})
        for step, cost in facts["steps"].items():
            metrics.update({f"ours/{name}/{step}_{key}": value for key, value in cost.items()})
    return metrics


def main() -> int:
    """Run, print the table, check the expectations."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with the real logs")
    parser.add_argument("--weights", type=Path, help="ONNX detector [default: DATA/detectors/yolox_nano.onnx]")
    parser.add_argument("--out", type=Path, default=Path("outputs/experiments/real"))
    parser.add_argument("--only", nargs="*", help="only these logs")
    arguments = parser.parse_args()
    weights = arguments.weights or arguments.data / "detectors" / "yolox_nano.onnx"
    pipeline = read_pipeline(pipeline_path("reconstruct"))
    expectations = tomllib.loads(EXPECTATIONS.read_text())
    rows: dict[str, dict[str, Any]] = {}
    problems = []
    for name, expected in expectations.items():
        if arguments.only and name not in arguments.only:
            continue
        log = expected["log"]
        path = arguments.out / log[1:] if log.startswith("@") else arguments.data / log
        settings = {"log": str(path), "backend": "detector", "weights": str(weights), "every": str(expected["every"])}
        settings |= expected.get("settings", {})
        print(f"== {name}", file=sys.stderr, flush=True)
        reports = run_pipeline(
            pipeline, arguments.out / name, settings, announce=lambda text: print(text, file=sys.stderr)
        )
        if reports[-1].exit_code != 0:
            print(f"{name}: step {reports[-1].name} ended with {reports[-1].exit_code}", file=sys.stderr)
            return reports[-1].exit_code
        rows[name] = facts_of_run(arguments.out / name)
        problems += [f"{name}: {problem}" for problem in unmet(expected, rows[name])]
    (arguments.out / "metrics.json").write_text(json.dumps(flat_metrics(rows), indent=1, sort_keys=True) + "\n")
    (arguments.out / "table.md").write_text(table(rows))
    print(table(rows))
    for problem in problems:
        print(f"expectation not met: {problem}", file=sys.stderr)
    return 4 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
