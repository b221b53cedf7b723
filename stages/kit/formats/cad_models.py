"""Models of the CAD library on disk: find, load and pose their parts.

A part frame has its origin at the joint's origin and axes parallel to the model frame at joint value 0; the body's part
frame is the model frame (docs/FORMATS.md, cad_library).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadLibrary, CadModel
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation

MODEL_FILE = "model.json"
URDF_FILE = "model.urdf"
REBUILD = "build the CAD library again"


def model_folder(library: CadLibrary, model_id: str) -> Path:
    """Return the folder of a model of the library. Raises BadInput when it is not there."""
    folder = library.path("models") / model_id
    if not folder.is_dir():
        raise BadInput(f"{library.root}: no model {model_id!r}", hint=REBUILD)
    return folder


def read_model(folder: Path) -> CadModel:
    """Return the description that lies inside a model folder (`model.json`). Raises BadInput."""
    path = Path(folder) / MODEL_FILE
    model = CadModel.read(path)
    if not model.parts or len(set(model.parts)) < len(model.parts):
        raise BadInput(f"{path}: parts {model.parts} are none or not different", hint=REBUILD)
    for joint in model.joints:
        if joint.part not in model.parts:
            raise BadInput(f"{path}: joint {joint.name!r} moves {joint.part!r}, which is no part", hint=REBUILD)
    _check_parents(model, path)
    return model


def _check_parents(model: CadModel, path: Path) -> None:
    """Raise BadInput when a joint hangs on what is no part, or on itself in a circle."""
    parents = {joint.part: joint.parent for joint in model.joints if joint.parent is not None}
    for part, parent in parents.items():
        if parent not in model.parts:
            raise BadInput(f"{path}: part {part!r} hangs on {parent!r}, which is no part", hint=REBUILD)
        above, steps = parent, 0
        while above in parents and steps <= len(parents):
            above, steps = parents[above], steps + 1
        if steps > len(parents):
            raise BadInput(f"{path}: part {part!r} hangs on itself in a circle", hint=REBUILD)


def part_transforms(model: CadModel, joints: dict[str, float]) -> dict[str, np.ndarray]:
    """Return part -> (4, 4) model_from_part at the given joint values [rad, m at scale 1]; missing ones are 0.

    Raises BadInput for a joint that the model does not have.
    """
    unknown = set(joints) - {joint.name for joint in model.joints}
    if unknown:
        raise BadInput(
            f"model {model.id}: no joint {sorted(unknown)[0]!r}",
            hint=f"it has: {', '.join(joint.name for joint in model.joints) or 'none'}",
        )
    part_poses, origins, parents = {}, {}, {}
    for joint in model.joints:
        value = joints.get(joint.name, 0.0)
        axis, origin = np.asarray(joint.axis), np.asarray(joint.origin)
        if joint.type == "revolute":
            part_poses[joint.part] = transform_from(Rotation.from_rotvec(value * axis).as_matrix(), origin)
        else:
            part_poses[joint.part] = transform_from(np.eye(3), origin + value * axis)
        origins[joint.part], parents[joint.part] = origin, joint.parent

    def placed(part: str) -> np.ndarray:
        if part not in part_poses:
            return np.eye(4)
        parent = parents[part]
        if parent is None or parent not in part_poses:
            return part_poses[part]
        # part frames are parallel to the model frame at value 0, so that the parent's own pose then is its origin
        return placed(parent) @ transform_from(np.eye(3), -origins[parent]) @ part_poses[part]

    return {part: placed(part) for part in model.parts}


def load_visual_parts(folder: Path) -> dict[str, trimesh.Trimesh]:
    """Return part -> visual mesh in the part frame [m], with the vertex colours of the file. Raises BadInput."""
    files = sorted((Path(folder) / "visual").glob("*.glb"))
    if not files:
        raise BadInput(f"{folder}: no visual/<part>.glb", hint=REBUILD)
    return {file.stem: read_mesh(file, hint=REBUILD) for file in files}


def load_collision_parts(folder: Path) -> dict[str, list[trimesh.Trimesh]]:
    """Return part -> convex collision pieces in the part frame [m], in the order of their numbers. Raises BadInput."""
    numbered: dict[str, list[tuple[int, Path]]] = {}
    for file in (Path(folder) / "collision").glob("*.obj"):
        match = re.fullmatch(r"(.+)_(\d+)", file.stem)
        if match is None:
            raise BadInput(f"{file}: not named <part>_<number>.obj", hint=REBUILD)
        numbered.setdefault(match[1], []).append((int(match[2]), file))
    if not numbered:
        raise BadInput(f"{folder}: no collision/<part>_<number>.obj", hint=REBUILD)
    return {part: [read_mesh(file, hint=REBUILD) for _, file in sorted(numbered[part])] for part in sorted(numbered)}


def posed_mesh(folder: Path, model: CadModel, joints: dict[str, float], scale: float = 1.0) -> trimesh.Trimesh:
    """Return the whole visual mesh in the model frame at the joint values, times `scale`, colours kept.

    Prismatic values are those of scale 1: the scale multiplies the posed geometry.
    """
    transforms = part_transforms(model, joints)
    part_meshes = load_visual_parts(folder)
    placed = []
    for part in model.parts:
        if part not in part_meshes:
            raise BadInput(f"{folder}: no visual/{part}.glb", hint=REBUILD)
        mesh = part_meshes[part]
        mesh.apply_transform(transforms[part])
        placed.append(mesh)
    combined = placed[0] if len(placed) == 1 else cast(trimesh.Trimesh, trimesh.util.concatenate(placed))
    combined.apply_scale(scale)
    return combined


def posed_collision(
    folder: Path, model: CadModel, joints: dict[str, float], scale: float = 1.0
) -> list[trimesh.Trimesh]:
    """Return the convex collision pieces of all parts in the model frame at the joint values, times `scale`."""
    transforms = part_transforms(model, joints)
    part_pieces = load_collision_parts(folder)
    placed = []
    for part in model.parts:
        for piece in part_pieces.get(part, []):
            piece.apply_transform(transforms[part])
            piece.apply_scale(scale)
            placed.append(piece)
    return placed
