"""Horizontal planes on top of a body, from its collision shapes: for bodies whose graph node names none."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import SurfacePlane

MERGE_HEIGHT = 0.01
"""Faces whose heights differ by less are one plane [m]; by eye."""
LEAST_AREA = 0.02
"""Smaller planes are left out [m^2]; by eye."""


def top_planes(meshes: list[trimesh.Trimesh]) -> tuple[SurfacePlane, ...]:
    """Return planes of upward faces [m], each with its bounding rectangle, of meshes in the world frame.

    Faces within 1 cm of height are one plane; planes under 0.02 m^2 are left out.
    """
    faces = []
    for mesh in meshes:
        up = mesh.face_normals[:, 2] > 0.98
        for triangle, area in zip(mesh.triangles[up], mesh.area_faces[up], strict=True):
            faces.append((float(triangle[:, 2].mean()), float(area), triangle))
    planes = []
    while faces:
        height = faces[0][0]
        group = [entry for entry in faces if abs(entry[0] - height) < MERGE_HEIGHT]
        faces = [entry for entry in faces if abs(entry[0] - height) >= MERGE_HEIGHT]
        area = sum(entry[1] for entry in group)
        if area < LEAST_AREA:
            continue
        top = max(entry[0] for entry in group)
        points = np.concatenate([entry[2] for entry in group])
        low, high = points.min(axis=0), points.max(axis=0)
        corners = [(low[0], low[1], top), (high[0], low[1], top), (high[0], high[1], top), (low[0], high[1], top)]
        planes.append(
            SurfacePlane(
                normal=(0.0, 0.0, 1.0),
                offset=-top,
                area=area,
                center=as_vector(np.mean(corners, axis=0)),
                corners=tuple(as_vector(np.array(corner)) for corner in corners),
                horizontal=True,
            )
        )
    return tuple(planes)
