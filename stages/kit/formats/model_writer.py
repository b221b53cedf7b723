"""Write a model folder of the CAD library: URDF, GLB and OBJ visuals, convex OBJ collision pieces, model.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.stages.kit.formats.cad_models import MODEL_FILE, URDF_FILE
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint, write_urdf
from scenewright.stages.kit.geometry.solids import MassProperties, Solid
from scenewright.stages.kit.geometry.transforms import transform_from

HINGE_DAMPING, SLIDE_DAMPING = 0.3, 4.0
"""Damping [N m s/rad], [N s/m]: a door or drawer that is let go comes to rest within a second or two."""
HINGE_FRICTION, SLIDE_FRICTION = 0.1, 1.0
"""Friction of joints [N m], [N]; by eye."""
HINGE_EFFORT, SLIDE_EFFORT = 30.0, 60.0
"""Largest effort of joints [N m], [N]; by eye."""


class Faceted(Protocol):
    """Anything with vertices (V, 3) [m] and triangles (F, 3)."""

    @property
    def vertices(self) -> np.ndarray: ...

    @property
    def faces(self) -> np.ndarray: ...


@dataclass(frozen=True)
class PartGeometry:
    """One link in its part frame: convex solids, a colour for each, mass properties."""

    name: str
    solids: Sequence[Solid]
    colors: Sequence[tuple[int, int, int]]
    properties: MassProperties
    visual: Sequence[Faceted] = ()
    """What it looks like, when that is not the solids."""
    visual_colors: Sequence[tuple[int, int, int]] = ()
    """One for each of `visual`."""


def write_model_folder(folder: Path, model: CadModel, parts: Sequence[PartGeometry]) -> None:
    """Write a self-contained model folder with stable bytes. The first part is the body, the rest hang on its joints.

    `visual/<part>.glb` holds the part with vertex colours; `visual/<part>_<k>.obj` the same, one file a colour, for
    loaders that know no GLB (pybullet), and the URDF names those; `collision/<part>_<k>.obj` one convex piece each.
    """
    folder = Path(folder)
    for name in ("visual", "collision"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    links = []
    for part in parts:
        shapes: Sequence[Faceted] = part.visual or part.solids
        colors = part.visual_colors if part.visual else part.colors
        (folder / "visual" / f"{part.name}.glb").write_bytes(glb_bytes(colored_mesh(shapes, colors)))
        visuals, collisions = [], []
        palette = list(dict.fromkeys(colors))
        for k, color in enumerate(palette):
            mesh = colored_mesh([s for s, c in zip(shapes, colors, strict=True) if c == color], None)
            name = f"visual/{part.name}_{k}.obj"
            write_obj(folder / name, mesh.vertices, mesh.faces)
            visuals.append(Shape(mesh=name, color=(color[0] / 255, color[1] / 255, color[2] / 255, 1.0)))
        for k, solid in enumerate(part.solids):
            name = f"collision/{part.name}_{k}.obj"
            write_obj(folder / name, solid.vertices, solid.faces)
            collisions.append(Shape(mesh=name))
        links.append(Link(part.name, part.properties, tuple(visuals), tuple(collisions)))
    body = parts[0].name
    joints = []
    origins = {joint.part: np.asarray(joint.origin, dtype=float) for joint in model.joints}
    for joint in model.joints:
        parent = joint.parent or body
        revolute = joint.type == "revolute"
        joints.append(
            UrdfJoint(
                name=joint.name,
                type=joint.type,
                parent=parent,
                child=joint.part,
                parent_from_child=transform_from(np.eye(3), origins[joint.part] - origins.get(parent, np.zeros(3))),
                axis=joint.axis,
                lower=joint.lower,
                upper=joint.upper,
                effort=HINGE_EFFORT if revolute else SLIDE_EFFORT,
                velocity=3.0 if revolute else 1.0,
                damping=HINGE_DAMPING if revolute else SLIDE_DAMPING,
                friction=HINGE_FRICTION if revolute else SLIDE_FRICTION,
            )
        )
    write_urdf(folder / URDF_FILE, Urdf(model.id, tuple(links), tuple(joints)))
    model.write(folder / MODEL_FILE)


def colored_mesh(solids: Sequence[Faceted], colors: Sequence[tuple[int, int, int]] | None) -> trimesh.Trimesh:
    """Return the solids as one mesh, vertices in their order; vertex colours when `colors` (one a solid) is given."""
    vertices = np.concatenate([solid.vertices for solid in solids])
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    faces = np.concatenate([solid.faces + start for solid, start in zip(solids, starts, strict=False)])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if colors is not None:
        counts = [len(solid.vertices) for solid in solids]
        rgba = np.array([(*color, 255) for color in colors], dtype=np.uint8)
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.repeat(rgba, counts, axis=0))
    return mesh


def glb_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Return the mesh as binary glTF; the same mesh gives the same bytes."""
    return trimesh.exchange.gltf.export_glb(trimesh.Scene([mesh]), include_normals=False)


def write_obj(path: Path, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None = None) -> None:
    """Write vertices (V, 3) [m] and triangles (F, 3) as OBJ with stable bytes; `colors`: (V, 3) uint8 or None."""
    rounded = np.round(np.asarray(vertices, dtype=float), 7) + 0.0
    if colors is None:
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in rounded.tolist()]
    else:
        shades = np.round(np.asarray(colors)[:, :3] / 255.0, 4).tolist()
        lines = [
            f"v {x:.7g} {y:.7g} {z:.7g} {r:.4g} {g:.4g} {b:.4g}"
            for (x, y, z), (r, g, b) in zip(rounded.tolist(), shades, strict=True)
        ]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")
