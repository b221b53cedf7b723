"""Mesh files that URDF and SDF name, as surfaces of their links."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.library.importing.limits import Allowance
from scenewright.stages.library.importing.mesh_reading import read_mesh_file
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import Surface, painted_faces


@dataclass(frozen=True)
class Naming:
    """The description that names meshes, and what is gathered about them."""

    folder: SourceFolder
    path: Path
    findings: list[str]
    units: set[float]
    allowance: Allowance


def mesh_surfaces(
    by: Naming, name: str, link_from_mesh: np.ndarray, color: tuple[float, float, float] | None, label: str
) -> list[Surface]:
    """Return the surfaces of a mesh file that a description names; `link_from_mesh` (4, 4) may scale.

    A COLLADA file's unit is applied and noted, its up axis is not: simulators read it so. Raises BadInput for a missing
    file, and for more than the description's allowance.
    """
    folder, path = by.folder, by.path
    file = folder.find(name, path.parent)
    if file is None:
        raise BadInput(f"{path}: mesh {name!r:.100} is not in the folder", hint="copy it beside the description")
    if not file.is_relative_to(path.parent) or ".." in Path(name).parts:
        by.findings.append("meshes are named elsewhere; files of the same path were found in the folder")
    content = read_mesh_file(folder, file)
    unit = 1.0
    if isinstance(content.unit.value, float) and content.unit.origin == "file":
        unit = content.unit.value
        by.units.add(unit)
    by.findings.extend(content.findings)
    by.allowance.take(content.surfaces)
    scaled_pose = link_from_mesh @ np.diag([unit, unit, unit, 1.0])
    moved = []
    for surface in content.surfaces:
        colors = surface.colors
        if color is not None and file.suffix.lower() in (".stl", ".obj") and len(np.unique(colors, axis=0)) == 1:
            colors = painted_faces(len(surface.faces), color)
        name_of_surface = f"{label} {file.stem} {surface.name}".strip()
        placed = replace(surface, colors=colors, name=name_of_surface, mesh_origin=np.zeros(3), mesh_unit=unit)
        moved.append(placed.moved(scaled_pose))
    return moved
