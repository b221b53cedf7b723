"""A contact sheet of a CAD library, a tile a class: python docs/library_sheet.py LIBRARY PICTURE [MODEL_ID ...].

Doors, drawers and lids stand half open. With model ids only those are shown. The table of classes in docs/FORMATS.md is
printed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scenewright.schemas.cad_library import Affordances, CadLibrary, CadModel
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.cad_models import model_folder, posed_mesh
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer

TILE, CAPTION, COLUMNS = 168, 18, 9
"""Tile edge and height of the line of text [px]; tiles side by side."""
VIEW = np.array([-0.55, -1.0, 0.62])
"""From the middle of a model towards the camera."""


def shown_state(model: CadModel, library: CadLibrary) -> dict[str, float]:
    """Return joint values: what opens half open, what stands before something else fully; knobs and levers at 0."""
    found = {entry.model: entry for entry in library.library.affordances}[model.id]
    before = {name for use in found.joints for name in use.behind}
    share = {name: 1.0 if name in before else 0.5 for name in found.openable}
    return {joint.name: share.get(joint.name, 0.0) * joint.upper for joint in model.joints}


def tile(library: CadLibrary, model: CadModel) -> np.ndarray:
    """Return the picture (TILE + CAPTION, TILE, 3) BGR of one model."""
    mesh = posed_mesh(model_folder(library, model.id), model, shown_state(model, library))
    middle, reach = mesh.bounds.mean(axis=0), float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    eye = middle + 1.9 * reach * VIEW / np.linalg.norm(VIEW)
    focal = 1.75 * TILE
    camera = Camera(width=TILE, height=TILE, fx=focal, fy=focal, cx=0.5 * TILE - 0.5, cy=0.5 * TILE - 0.5)
    color = SceneRenderer([(1, mesh)]).render(camera, look_at(eye, middle)).color[:, :, ::-1]
    caption = np.full((CAPTION, TILE, 3), 255, dtype=np.uint8)
    cv2.putText(
        caption, model.id.rsplit("_", 1)[0], (4, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA
    )
    return np.vstack([color, caption])


def class_table(library: CadLibrary) -> str:
    """Return a Markdown table, a row a class: joints of its shapes, what they contain, carry and how they are held."""
    rows = ["| class | joints | carried | contains | carries on top | grasped at |", "|---|---|---|---|---|---|"]
    by_class: dict[str, list[Affordances]] = {}
    for model, uses in zip(library.library.models, library.library.affordances, strict=True):
        by_class.setdefault(model.class_name, []).append(uses)
    for name, every in by_class.items():
        kinds = sorted({use.kind for uses in every for use in uses.joints})
        joints = [f"{_span([sum(u.kind == kind for u in uses.joints) for uses in every])} {kind}" for kind in kinds]
        rooms = _span([len(uses.contains) for uses in every])
        tops = _span([sum(not surface.inside for surface in uses.carries) for uses in every])
        grasps = _span([len(uses.grasps) for uses in every])
        carried = "yes" if every[0].movable else ""
        cells = [", ".join(joints), carried, *("" if cell == "0" else cell for cell in (rooms, tops, grasps))]
        rows.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(rows)


def _span(counts: list[int]) -> str:
    return str(min(counts)) if min(counts) == max(counts) else f"{min(counts)}-{max(counts)}"


def main(root: Path, picture: Path, names: list[str]) -> None:
    """Write the sheet: the first model of every class, or those named."""
    library = CadLibrary(root)
    first: dict[str, CadModel] = {}
    for model in library.library.models:
        if not names:
            first.setdefault(model.class_name, model)
        elif model.id in names:
            first[model.id] = model
    tiles = [tile(library, model) for model in first.values()]
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % COLUMNS)
    sheet = np.vstack([np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)])
    cv2.imwrite(str(picture), sheet, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(class_table(library))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
