"""A run folder with one artifact of every kind, made without the chain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary

from tests.unit.viewing import artifacts
from tests.unit.viewing.suture_artifacts import make_suture
from tests.unit.viewing.tableware_artifacts import make_tableware


def make_tiny_run(folder: Path) -> Path:
    """Write every kind into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    artifacts.make_sequence(folder)
    artifacts.make_segments(folder)
    artifacts.make_disparity(folder)
    labels = {name: np.full(8, 4, np.int32) for name in ("instance", "segment", "class_id")}
    np.savez(artifacts.make_map(folder) / "mesh_labels.npz", **labels)
    artifacts.seal(folder / "panoptic_map", "panoptic_map", sequence=folder / "sequence")
    library = CadLibrary(root=artifacts.make_library(folder))
    artifacts.make_contact_graph(folder, library)
    artifacts.make_cad_scene(folder, library)
    artifacts.make_interactive_scene(folder, library)
    rows = 4
    np.savez(
        artifacts.make_plan(folder) / "trajectory.npz",
        time=np.arange(rows) / 10,
        joints=np.zeros((rows, 9)),
        action=np.zeros(rows, np.int32),
        world_from_base=np.tile(np.eye(4), (rows, 1, 1)),
    )
    artifacts.seal(folder / "plan", "plan", scene=folder / "interactive_scene")
    artifacts.make_packing(folder)
    trimesh.creation.box((4, 3, 2.5)).export(artifacts.make_ground_truth(folder, library) / "mesh.ply")
    artifacts.seal(folder / "ground_truth", "ground_truth", library=folder / "cad_library")
    artifacts.make_evaluation(folder)
    artifacts.make_report(folder)
    artifacts.make_trajectory(folder)
    artifacts.make_export(folder)
    make_tableware(folder)
    make_suture(folder)
    return folder
