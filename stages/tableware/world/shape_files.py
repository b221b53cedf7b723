"""The shapes of tableware as mesh files, for viewers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.ply_files import ColoredMesh, write_ply
from scenewright.stages.tableware.world.dish_shapes import item_mesh
from scenewright.stages.tableware.world.items import STANDARD, DishSizes, Kind, make_item

COLORS: dict[Kind, tuple[int, int, int]] = {
    "bowl": (91, 143, 201),
    "cup": (224, 144, 74),
    "plate": (154, 165, 177),
    "fork": (75, 85, 99),
    "spoon": (124, 92, 168),
}
"""Kind -> colour (RGB) of its mesh."""


def write_shapes(folder: Path, sizes: DishSizes = STANDARD) -> None:
    """Write `shapes/<kind>.ply`: the item at the origin, as it stands on a table."""
    (folder / "shapes").mkdir()
    for kind in sizes.kinds:
        mesh = item_mesh(make_item(kind, kind, 0.0, 0.0, sizes=sizes))
        colors = np.tile(np.array(COLORS[kind], dtype=np.uint8), (len(mesh.vertices), 1))
        shape = ColoredMesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), colors)
        write_ply(folder / "shapes" / f"{kind}.ply", shape)
