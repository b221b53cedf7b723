"""A small seeded room through the chain: masks with errors, map, contact graph, CAD scene, and their figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenewright.cli.main import run

from tests.quality.limits import misses

pytestmark = pytest.mark.slow

SIZE = ("--frames", "30", "--width", "240", "--height", "180")

AT_LEAST = {
    "map/pq": 0.68,
    "map/mesh_recall": 0.960,
    "graph/support_f1": 0.73,
    "graph/obb_ap50_refined": 0.62,
    "replacement/scan2cad_success": 0.70,
    "replacement/functional": 0.46,
}
"""The room has 30 objects: one that is named, carried or replaced otherwise moves a share by about 0.03, PQ by 0.02."""
AT_MOST = {
    "map/accuracy_mean_mm": 4.15,
    "graph/edit_distance": 14,
    "cad/position_error_ground_m_median": 0.0138,
    "replacement/collisions": 0,
}


def figures(folder: Path) -> dict[str, float]:
    """Return all metrics of the room."""

    def step(name: str, out: str, *options: str, **inputs: str) -> None:
        given = [word for role, at in inputs.items() for word in (f"--{role.replace('_', '-')}", str(folder / at))]
        assert run([*name.split(), *given, *options, "--out", str(folder / out), "--quiet"]) == 0, name

    step("library build", "library", "--shapes-per-class", "2", "--small-shapes-per-class", "2", "--seed", "1")
    step("synthesize", "truth", *SIZE, "--seed", "3", library="library")
    step("ingest", "sequence", log="truth/log.mcap")
    step("segment", "segments", "--backend", "ground-truth", "--corruption", "0.2", sequence="sequence")
    step("fuse", "map", sequence="sequence", segments="segments")
    step("graph", "graph", panoptic_map="map")
    step("cad", "cad", contact_graph="graph", panoptic_map="map", library="library")
    shown = {"panoptic_map": "map", "contact_graph": "graph", "cad_scene": "cad", "cad_library": "library"}
    step("evaluate", "evaluation", ground_truth="truth", sequence="sequence", segments="segments", **shown)
    metrics: dict[str, float] = json.loads((folder / "evaluation" / "metrics.json").read_text())["metrics"]
    return metrics


def test_a_room_is_mapped_understood_and_replaced(tmp_path: Path) -> None:
    assert not misses(figures(tmp_path), AT_LEAST, AT_MOST)
