"""Box-shaped CAD models on disk."""

from __future__ import annotations

from pathlib import Path

import trimesh
from scenewright.schemas.cad_library import CadModel, ModelState


def write_box_model(root: Path, model_id: str, class_name: str, size, color=(180, 90, 40)) -> Path:
    """Write `<root>/<model_id>` with one part, a box of `size` (3,) [m] that stands on the middle of its bottom."""
    x, y, z = (float(value) for value in size)
    folder = root / model_id
    (folder / "visual").mkdir(parents=True)
    (folder / "collision").mkdir()
    box = trimesh.creation.box(bounds=[(-x / 2, -y / 2, 0), (x / 2, y / 2, z)])
    box.export(folder / "collision" / "body_0.obj")
    box.visual.vertex_colors = (*color, 255)
    box.export(folder / "visual" / "body.glb")
    state = ModelState(joints={}, box_minimum=(-x / 2, -y / 2, 0), box_maximum=(x / 2, y / 2, z), planes=())
    CadModel(
        id=model_id, class_name=class_name, articulated=False, mass=1.0, states=(state,), movable=False, parts=("body",)
    ).write(folder / "model.json")
    return folder
