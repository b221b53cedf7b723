"""The candidates of each object as small pictures: the object's mesh, then what was tried in its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scenewright.schemas.cad_scene import CadCandidate, CadScene, Replacement
from scenewright.schemas.contact_graph import GraphNode
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.measurement.cad_candidates import before_check, candidates_of, same_placement
from scenewright.stages.kit.measurement.shape_symmetry import rotation_angle
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.rendering.surfaces import build_soup
from scenewright.stages.report.images import Picture, jpeg
from scenewright.stages.report.placed_models import ModelShelf
from scenewright.stages.report.surfaces import Model
from scenewright.stages.report.views import Bounds, View, best_azimuth, direction_of, fitted_pose, page_camera

ELEVATION = np.radians(28.0)
"""Angle from which candidates are looked at over the horizontal [rad]; by eye."""
QUALITY = 72
"""JPEG quality of the pictures of candidates; by eye."""


@dataclass(frozen=True)
class CandidateView:
    """A candidate as the page shows it."""

    picture: Picture | None
    """None when its model is not at hand."""
    model_id: str
    role: str
    """`chosen`, `best by itself`, or empty."""
    matching: str
    alignment: str
    scale: str


@dataclass(frozen=True)
class ObjectView:
    """An object with its candidates."""

    node: str
    picture: Picture | None
    """Its mesh in the map, seen from where the candidates are."""
    outcome: str
    candidates: tuple[CandidateView, ...]
    others: int
    """Candidates that are not shown."""
    rejected: tuple[tuple[str, int], ...]
    changed: bool
    """Whether the global check took another candidate or place than fitted best, or the object has none."""


def object_views(
    cad_scene: CadScene, shelf: ModelShelf, panoptic_map: PanopticMap | None, *, count: int, width: int
) -> list[ObjectView]:
    """Return every node that is no layout, in the order of the scene, with its `count` best candidates."""
    nodes = {node.id: node for node in cad_scene.graph.nodes}
    return [
        _object_view(r, nodes.get(r.node), cad_scene, shelf, panoptic_map, count, width)
        for r in cad_scene.info.replacements
        if r.decision != "layout"
    ]


def _object_view(
    replacement: Replacement,
    node: GraphNode | None,
    cad_scene: CadScene,
    shelf: ModelShelf,
    panoptic_map: PanopticMap | None,
    count: int,
    width: int,
) -> ObjectView:
    candidates = candidates_of(replacement)
    object_mesh = _object_mesh(replacement, node, cad_scene, panoptic_map)
    meshes = [
        shelf.mesh(candidate, replacement.part_colors if "chosen" in role else None)
        for role, candidate in candidates[:count]
    ]
    firsts = [m for (role, _), m in zip(candidates[:count], meshes, strict=True) if role] or meshes[:1]
    view = _common_view(object_mesh, firsts, node.class_name if node is not None else "object", width)
    candidate_views = tuple(
        CandidateView(
            picture=_draw(mesh, view, f"{candidate.model_id} in the place of {replacement.node}"),
            model_id=candidate.model_id,
            role=role,
            matching=f"{candidate.matching_error:.3f}",
            alignment=f"{1000 * candidate.alignment_error:.0f} mm",
            scale=f"{candidate.scale:.2f}",
        )
        for (role, candidate), mesh in zip(candidates[:count], meshes, strict=True)
    )
    chosen = replacement.chosen if replacement.decision == "cad" else None
    first = before_check(replacement)
    moved = chosen is not None and first is not None and not same_placement(first, chosen, 0.02, 0.05)
    return ObjectView(
        node=replacement.node,
        picture=_draw(object_mesh, view, f"mesh of {replacement.node}"),
        outcome=_outcome(replacement, chosen, first if moved else None),
        candidates=candidate_views,
        others=max(0, len(candidates) - count),
        rejected=tuple(sorted(replacement.rejected.items(), key=lambda item: (-item[1], item[0]))),
        changed=chosen is None or moved,
    )


def _outcome(replacement: Replacement, chosen: CadCandidate | None, before: CadCandidate | None) -> str:
    if chosen is None:
        return f"keeps its mesh: {replacement.reason}" if replacement.reason else "keeps its mesh"
    if before is None:
        return ""
    if before.model_id != chosen.model_id:
        return f"{before.model_id} fitted best by itself; the global check took {chosen.model_id}"
    first, last = np.array(before.world_from_model), np.array(chosen.world_from_model)
    shift = 100 * float(np.linalg.norm(last[:3, 3] - first[:3, 3]))
    turn = np.degrees(rotation_angle(first[:3, :3].T @ last[:3, :3]))
    corrections = [f"moved by {shift:.0f} cm" if shift >= 0.5 else "", f"turned by {turn:.0f}°" if turn >= 0.5 else ""]
    return " and ".join(correction for correction in corrections if correction) + " by the global check"


def _object_mesh(
    replacement: Replacement, node: GraphNode | None, cad_scene: CadScene, panoptic_map: PanopticMap | None
) -> trimesh.Trimesh | None:
    """The object's mesh in the map (world frame), else the copy that the CAD scene kept; None when neither is there."""
    paths = [cad_scene.path("meshes") / f"{replacement.node}.ply"]
    if panoptic_map is not None and node is not None and node.mesh is not None:
        paths.insert(0, panoptic_map.path(node.mesh))
    for path in paths:
        if path.is_file():
            mesh = read_mesh(path, may_be_empty=True)
            return mesh if len(mesh.faces) else None
    return None


def _common_view(
    object_mesh: trimesh.Trimesh | None, meshes: list[trimesh.Trimesh | None], class_name: str, width: int
) -> View | None:
    """A view that shows all of them whole, from the side of which most was seen."""
    framed = [mesh for mesh in (object_mesh, *meshes) if mesh is not None]
    if not framed:
        return None
    bounds = Bounds(
        np.min([mesh.bounds[0] for mesh in framed], axis=0), np.max([mesh.bounds[1] for mesh in framed], axis=0)
    )
    azimuth = best_azimuth(Model(build_soup([(1, framed[0])]), {1: class_name}, {}))
    camera = page_camera(2 * width, round(1.7 * width))
    return View(camera, fitted_pose(camera, bounds, direction_of(azimuth, ELEVATION)))


def _draw(mesh: trimesh.Trimesh | None, view: View | None, alt: str) -> Picture | None:
    if mesh is None or view is None:
        return None
    # Rendered twice as large as shown: scaling down smooths the edges.
    color = SceneRenderer([(1, mesh)], antialias=False).render(view.camera, view.world_from_camera).color
    return jpeg(color, alt, view.camera.width // 2, QUALITY)
