"""Triangle soups of the artifacts, with what belongs to which node, for pictures of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from scenewright.schemas.cad_scene import SURROUNDINGS, CadCandidate, CadScene
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.drawing.palette import LAYOUT_COLORS, UNLABELLED, entity_color
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.scene_links import INFERRED
from scenewright.stages.kit.geometry.solids import hull_or_box
from scenewright.stages.kit.measurement.cad_candidates import after_check
from scenewright.stages.kit.rendering.surfaces import TriangleSoup, build_soup, srgb_to_linear
from scenewright.stages.report.placed_models import ModelShelf

NAMELESS = 99_999
"""Instance of the surroundings; no node has it."""


@dataclass(frozen=True)
class Model:
    """A soup and the meaning of its instance numbers."""

    soup: TriangleSoup
    classes: dict[int, str]
    """Instance -> class name; instances that are missing are unlabelled."""
    names: dict[int, str]
    """Instance -> what to call it in pictures; floor, walls and ceiling need no name."""
    nodes: dict[int, str] = field(default_factory=dict)
    """Instance -> node of the graph, where it is one."""

    def _table(self, names: set[str], unlabelled: bool) -> np.ndarray:
        """(T,) bool: triangles of instances whose class is in `names`."""
        table = np.full(int(self.soup.instance.max(initial=0)) + 1, unlabelled)
        for instance, name in self.classes.items():
            if 0 <= instance < len(table):
                table[instance] = name in names
        return table[self.soup.instance]

    @cached_property
    def centers(self) -> np.ndarray:
        """(T, 3) centres of the triangles."""
        return self.soup.corners.mean(axis=1)

    @cached_property
    def things(self) -> np.ndarray:
        """(T,) bool: triangles of things."""
        return self._table({entry.name for entry in load_vocabulary().classes if not entry.is_layout}, False)

    @cached_property
    def solid(self) -> np.ndarray:
        """(T,) bool: triangles that are never cut away, those of things and floors."""
        return self.things | self._table({"floor"}, False)

    @cached_property
    def ceiling(self) -> np.ndarray:
        """(T,) bool: triangles of ceilings."""
        return self._table({"ceiling"}, False)

    def inward_sign(self, center: np.ndarray) -> float:
        """+1 when the normals of the room's shell look towards `center`, as a scan's do, -1 when the mesh is turned
        inside out."""
        loose = ~self.solid
        corners = self.soup.corners[loose]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        inward = np.einsum("ij,ij->i", self.soup.face_normals[loose], center - self.centers[loose])
        return -1.0 if float(np.sum(area * np.sign(inward))) < 0 else 1.0

    def by_instance(self) -> Model:
        """The same shape, coloured by instance."""
        values, inverse = np.unique(self.soup.instance, return_inverse=True)
        table = srgb_to_linear(
            np.array(
                [entity_color(int(v), self.classes[int(v)]) if int(v) in self.classes else UNLABELLED for v in values]
            )
        )
        colors = np.repeat(table[inverse][:, None, :], 3, axis=1)
        return replace(self, soup=replace(self.soup, corner_colors=colors.astype(np.float32)))


def map_model(panoptic_map: PanopticMap) -> Model | None:
    """The whole map in the colours of the images; a triangle belongs to the instance of most of its corners.

    None for an empty map.
    """
    mesh = _load(panoptic_map, "mesh.ply")
    if mesh is None:
        return None
    (labels,) = read_arrays(panoptic_map.path("mesh_labels.npz"), "instance", shapes=("V",), hint="make the map again")
    labels = labels.astype(np.int64)
    if len(labels) != len(mesh.vertices):
        raise BadInput(f"{panoptic_map.root.name}: {len(labels)} labels for {len(mesh.vertices)} vertices")
    a, b, c = labels[mesh.faces].T
    instance = np.where((b == c) & (a != b), b, a)
    is_kept = np.linalg.norm(mesh.face_normals, axis=1) > 0.5
    corners = mesh.vertices[mesh.faces]
    is_kept &= np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-12
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[is_kept], vertex_colors=_vertex_colors(mesh), process=False)
    soup = replace(build_soup([(0, mesh)]), instance=instance[is_kept].astype(np.int32))
    entities = panoptic_map.info.entities
    return Model(
        soup,
        {e.instance: e.class_name for e in entities},
        {
            e.instance: f"{e.class_name} {e.instance}".replace("_", " ")
            for e in entities
            if e.class_name not in LAYOUT_COLORS
        },
    )


def _vertex_colors(mesh: trimesh.Trimesh) -> np.ndarray:
    visual: Any = mesh.visual
    if visual is not None and visual.kind == "vertex":
        return np.asarray(visual.vertex_colors)
    return np.full((len(mesh.vertices), 4), 170, dtype=np.uint8)


def cad_model(
    cad_scene: CadScene, shelf: ModelShelf | None = None, candidates: Mapping[str, CadCandidate | None] | None = None
) -> Model | None:
    """The CAD scene: models where they stand, reconstructed meshes where there is none (what is inferred of them in a
    colour of its own), layout, surroundings.

    `candidates`: node -> what stands for it, instead of what the scene chose; their models come from `shelf`.
    """
    shelf = shelf or ModelShelf(cad_scene)
    nodes = {node.id: node for node in cad_scene.graph.nodes}
    meshes: list[tuple[int, trimesh.Trimesh]] = []
    classes: dict[int, str] = {}
    names: dict[int, str] = {}
    node_ids: dict[int, str] = {}
    for row, replacement in enumerate(cad_scene.info.replacements, start=1):
        node = nodes.get(replacement.node)
        class_name = node.class_name if node is not None else "object"
        number = node.instance if node is not None and node.instance > 0 else 100_000 + row
        chosen = after_check(replacement) if candidates is None else candidates.get(replacement.node)
        if chosen is not None:
            is_chosen = replacement.chosen is not None and chosen.model_id == replacement.chosen.model_id
            mesh: trimesh.Trimesh | None = shelf.mesh(chosen, replacement.part_colors if is_chosen else None)
        else:
            where = "layout" if replacement.decision == "layout" else "meshes"
            mesh = _load(cad_scene, f"{where}/{replacement.node}.ply")
        if mesh is None:
            continue
        meshes.append((number, mesh))
        if chosen is None and replacement.inferred is not None:
            meshes += [(number, _inferred(np.array(corners))) for corners in replacement.inferred.pieces]
        classes[number] = class_name
        node_ids[number] = replacement.node
        if replacement.decision != "layout":
            names[number] = (f"{class_name} {number}" if node is not None else replacement.node).replace("_", " ")
    nameless = _load(cad_scene, f"meshes/{SURROUNDINGS}.ply") if candidates is None else None
    if nameless is not None:
        meshes.append((NAMELESS, nameless))
    return Model(build_soup(meshes), classes, names, node_ids) if meshes else None


def _inferred(corners: np.ndarray) -> trimesh.Trimesh:
    """Return a convex piece, corners (N, 3), in the colour of what nobody saw."""
    solid = hull_or_box(corners)
    color = np.round(255 * np.array(INFERRED)).astype(np.uint8)
    return trimesh.Trimesh(solid.vertices, solid.faces, vertex_colors=color, process=False)


def true_model(truth: GroundTruth, world_from_log: np.ndarray) -> Model | None:
    """The whole true surface, moved into the reconstruction's world; nothing is known of its parts."""
    mesh = _load(truth, "mesh.ply")
    if mesh is None:
        return None
    mesh.apply_transform(world_from_log)
    return Model(build_soup([(0, mesh)]), {}, {})


def _load(artifact: PanopticMap | CadScene | GroundTruth, name: str) -> trimesh.Trimesh | None:
    """Read a PLY of an artifact; None when it is absent or has no triangles."""
    path = artifact.path(name)
    if not path.is_file():
        return None
    mesh = read_mesh(path, may_be_empty=True)
    return mesh if len(mesh.faces) else None
