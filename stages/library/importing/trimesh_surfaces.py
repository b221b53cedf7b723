"""Meshes of trimesh as painted surfaces."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import trimesh
from scenewright.stages.library.importing.pictures import face_colors
from scenewright.stages.library.importing.source_model import Surface, painted_faces


def surface_of(mesh: trimesh.Trimesh, name: str) -> Surface:
    """Return a mesh with the colours of its faces: of its picture, its material or its vertices."""
    faces = np.asarray(mesh.faces)
    colors = painted_faces(len(faces), None)
    visual = mesh.visual
    if isinstance(visual, trimesh.visual.TextureVisuals):
        image = getattr(visual.material, "baseColorTexture", None) or getattr(visual.material, "image", None)
        with suppress(Exception):  # Pillow raises whatever its decoders raise; the colour is then the plain one
            if visual.uv is not None and image is not None:
                colors = face_colors(np.asarray(image.convert("RGB")), np.asarray(visual.uv)[faces])
            else:
                colors = np.tile(np.asarray(visual.material.main_color, dtype=np.uint8)[:3], (len(faces), 1))
    elif visual is not None and visual.kind is not None:
        colors = np.asarray(visual.face_colors, dtype=np.uint8)[:, :3]
    return Surface(np.asarray(mesh.vertices, dtype=float), faces, colors, name)
