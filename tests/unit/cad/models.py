"""A little CAD library for tests: chairs, tables, fridges with a door, boxes, laid out as the library step does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary, CadModel, LibraryFile, ModelState
from scenewright.schemas.scene_parts import Joint, SurfacePlane
from scenewright.stages.kit.formats.cad_models import part_transforms

from tests.panoptic_maps import box_mesh

OPENINGS = (0.0, 1.0, 2.0)
"""Door angles that are stored as states [rad]."""


def write_library(root: Path, models: dict[str, dict]) -> CadLibrary:
    """Write models (id -> class_name, parts: part -> boxes (low, high), joints) as an artifact of kind cad_library."""
    entries = []
    for model_id, spec in models.items():
        folder = root / "models" / model_id
        (folder / "visual").mkdir(parents=True)
        (folder / "collision").mkdir()
        for part, boxes in spec["parts"].items():
            pieces = [box_mesh(low, high) for low, high in boxes]
            trimesh.util.concatenate(pieces).export(folder / "visual" / f"{part}.glb")
            for k, piece in enumerate(pieces):
                piece.export(folder / "collision" / f"{part}_{k}.obj")
        joints = tuple(spec.get("joints", ()))
        model = CadModel(
            id=model_id,
            class_name=spec["class_name"],
            articulated=bool(joints),
            mass=1.0,
            states=(ModelState(joints={}, box_minimum=(0, 0, 0), box_maximum=(0, 0, 0), planes=()),),
            joints=joints,
            movable=False,
            parts=tuple(spec["parts"]),
        )
        values = [{joint.name: value for joint in joints} for value in (OPENINGS if joints else (0.0,))]
        states = tuple(state_of(model, spec["parts"], value) for value in values)
        model = model.model_copy(update={"states": states})
        model.write(folder / "model.json")
        entries.append(model)
    LibraryFile(seed=0, models=tuple(entries)).write(root / "library.json")
    return CadLibrary(root)


def state_of(model: CadModel, parts: dict, joints: dict[str, float]) -> ModelState:
    """Box and face planes of all the boxes at the joint values."""
    transforms = part_transforms(model, joints)
    corners, planes = [], []
    for part, boxes in parts.items():
        motion = transforms[part]
        for low, high in boxes:
            low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
            for axis in range(3):
                for side in (0, 1):
                    face = face_corners(low, high, axis, side) @ motion[:3, :3].T + motion[:3, 3]
                    corners.append(face)
                    normal = (2 * side - 1) * motion[:3, axis]
                    extent = np.delete(high - low, axis)
                    if np.prod(extent) < 0.01:
                        continue
                    planes.append(
                        SurfacePlane(
                            normal=tuple(normal),
                            offset=-float(normal @ face[0]),
                            area=float(np.prod(extent)),
                            center=tuple(face.mean(axis=0)),
                            corners=tuple(tuple(c) for c in face),
                            horizontal=bool(normal[2] > 0.9),
                        )
                    )
    points = np.concatenate(corners)
    return ModelState(
        joints=joints,
        box_minimum=tuple(points.min(axis=0)),
        box_maximum=tuple(points.max(axis=0)),
        planes=tuple(planes),
    )


def face_corners(low: np.ndarray, high: np.ndarray, axis: int, side: int) -> np.ndarray:
    """Corners (4, 3) of one face of a box."""
    first, second = (k for k in range(3) if k != axis)
    result = np.empty((4, 3))
    result[:, axis] = high[axis] if side else low[axis]
    result[:, first] = [low[first], high[first], high[first], low[first]]
    result[:, second] = [low[second], low[second], high[second], high[second]]
    return result


def chair(width: float, seat: float, height: float) -> dict:
    """Seat, back at +y, four legs."""
    half = width / 2
    boxes = [((-half, -half, seat - 0.03), (half, half, seat)), ((-half, half - 0.03, seat), (half, half, height))]
    for x in (-half, half - 0.04):
        for y in (-half, half - 0.04):
            boxes.append(((x, y, 0.0), (x + 0.04, y + 0.04, seat - 0.03)))
    return {"class_name": "chair", "parts": {"body": boxes}}


def table(x: float, y: float, z: float) -> dict:
    """Top and four legs."""
    boxes = [((-x / 2, -y / 2, z - 0.04), (x / 2, y / 2, z))]
    for sx in (-x / 2, x / 2 - 0.05):
        for sy in (-y / 2, y / 2 - 0.05):
            boxes.append(((sx, sy, 0.0), (sx + 0.05, sy + 0.05, z - 0.04)))
    return {"class_name": "table", "parts": {"body": boxes}}


def fridge(x: float, y: float, z: float, boards: tuple[float, ...]) -> dict:
    """An open carcass with boards and a door with its hinge at the right of the front."""
    wall, front = 0.03, -y / 2 + 0.05
    body = [
        ((-x / 2, y / 2 - wall, 0), (x / 2, y / 2, z)),
        ((-x / 2, front, 0), (-x / 2 + wall, y / 2 - wall, z)),
        ((x / 2 - wall, front, 0), (x / 2, y / 2 - wall, z)),
        ((-x / 2 + wall, front, 0), (x / 2 - wall, y / 2 - wall, wall)),
        ((-x / 2 + wall, front, z - wall), (x / 2 - wall, y / 2 - wall, z)),
    ]
    body += [((-x / 2 + wall, front + 0.05, h - 0.01), (x / 2 - wall, y / 2 - wall, h)) for h in boards]
    door = [((-x, -0.05, 0.0), (0.0, 0.0, z))]
    hinge = Joint(
        name="door_hinge",
        type="revolute",
        part="door",
        origin=(x / 2, front, 0.0),
        axis=(0.0, 0.0, 1.0),
        lower=0.0,
        upper=2.0,
    )
    return {"class_name": "fridge", "parts": {"body": body, "door": door}, "joints": [hinge]}


def block(class_name: str, x: float, y: float, z: float) -> dict:
    """One box."""
    return {"class_name": class_name, "parts": {"body": [((-x / 2, -y / 2, 0), (x / 2, y / 2, z))]}}
