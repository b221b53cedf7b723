"""From the nodes of cg' to the bodies of a scene."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import SURROUNDINGS, CadScene, Inferred, Replacement, SeenMotion
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.mobility import NAMELESS, STANDS, Mobility, mobility
from scenewright.stages.kit.formats.scene_bundle import BundleBody
from scenewright.stages.kit.formats.scene_supports import furniture_pieces, support_height
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.layout_slabs import Slab
from scenewright.stages.kit.geometry.steadiness import stands_steadily
from scenewright.stages.kit.measurement.layout_pieces import plates_of


def scene_bodies(
    cad_scene: CadScene, graph: ContactGraphFile, movable: Collection[str], fixed: Collection[str] = ()
) -> list[BundleBody]:
    """Return one body for every node but the root (its CAD model, else its mesh, else its box), and one for
    the surroundings: what was mapped and has no name.

    `movable`: classes that an arm carries; `fixed`: classes that stay where they are (`mobility`).
    Raises BadInput for a missing model or mesh.
    """
    replaced = {entry.node: entry for entry in cad_scene.info.replacements if entry.decision != "layout"}
    plates = {name: tuple(slabs) for name, slabs in plates_of(cad_scene.shell).items()}
    panels = () if cad_scene.shell is None else cad_scene.shell.panels
    doors = {panel.node: (panel, panel.hinge.because) for panel in panels if panel.hinge is not None}
    bodies = [
        _body(cad_scene, graph, node, mobility(graph, node, movable, fixed), replaced.get(node.id), plates.get(node.id))
        for node in graph.nodes
        if node.id != SCENE_NODE
    ]
    bodies = [
        replace(body, door=doors[body.name][0], because=f"inferred: a leaf on a hinge; {doors[body.name][1]}")
        if body.name in doors
        else body
        for body in held_under_fixed(bodies)
    ]
    nameless = cad_scene.path("meshes") / f"{SURROUNDINGS}.ply"
    return [*bodies, _surroundings(nameless)] if nameless.is_file() else bodies


def _body(
    cad_scene: CadScene,
    graph: ContactGraphFile,
    node: GraphNode,
    mobile: Mobility,
    replacement: Replacement | None,
    plates: tuple[Slab, ...] | None,
) -> BundleBody:
    link = graph.parent_link(node.id)
    relation = "supports" if link is None else link.relation
    held = mobile.why if relation == "unknown" else ""
    parent = None if link is None or link.source == SCENE_NODE else link.source
    added = None if replacement is None else replacement.inferred
    if node.model_id is not None:
        if node.world_from_model is None or node.scale is None:
            raise BadInput(
                f"{cad_scene.path('graph.json')}: node {node.id} has a model but no pose or scale",
                hint="run `cad` again",
            )
        folder = cad_scene.path("models") / node.model_id
        if not folder.is_dir():
            raise BadInput(f"{folder}: model of node {node.id} is missing", hint="run `cad` again")
        model = as_it_moved(read_model(folder), {} if replacement is None else replacement.motions)
        is_built_in = mobile.furniture and node.mark is None and "built_in" in model.recipe
        mobile = Mobility(False) if is_built_in else mobile
        return BundleBody(
            name=node.id,
            class_name=node.class_name,
            parent=parent,
            relation=relation,
            world_from_body=np.array(node.world_from_model),
            movable=mobile.movable,
            furniture=mobile.furniture,
            box=_box(node, None, cad_scene),
            model=model,
            model_folder=folder,
            scale=node.scale,
            joint_values=dict(node.joints),
            held=frozenset() if replacement is None else replacement.held,
            part_colors={} if replacement is None else dict(replacement.part_colors),
            because="held: it is built in" if is_built_in else _because(added, held),
        )
    mesh = _mesh(cad_scene, node)
    bounds = _box(node, mesh, cad_scene)
    origin = np.eye(4) if node.node_type == "layout" else _bottom(bounds)
    if mesh is not None:
        mesh.apply_translation(-origin[:3, 3])
    inferred = () if added is None else tuple(np.array(corners) - origin[:3, 3] for corners in added.pieces)
    if mobile.furniture and node.mark is None and mesh is not None:
        height = support_height(graph, {entry.id: entry for entry in graph.nodes}, node.id)
        if height is None or not _steady(mesh, inferred, height - float(origin[2, 3])):
            mobile, held = Mobility(False), "it would not stand" if added is None else added.because
    return BundleBody(
        name=node.id,
        class_name=node.class_name,
        parent=parent,
        relation=relation,
        world_from_body=origin,
        movable=mobile.movable,
        furniture=mobile.furniture,
        box=bounds,
        mesh=mesh,
        inferred=inferred,
        slabs=plates,
        because=_because(added, held),
    )


def _because(added: Inferred | None, held: str) -> str:
    if held:
        return f"held: {held}"
    return "" if added is None or not added.pieces else f"inferred: {added.what}; {added.because}"


def _steady(mesh: trimesh.Trimesh, inferred: Sequence[np.ndarray], height: float) -> bool:
    """Whether a mesh stands at a height [m] with what is inferred of it, all in one frame, z up."""
    seen = furniture_pieces(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces), height)
    return stands_steadily([*seen, *inferred], height)


def as_it_moved(model: CadModel, motions: Mapping[str, SeenMotion]) -> CadModel:
    """Return a model whose joints turn about, or slide along, the axes that the log shows them move by, at least as far
    as it shows. `motions`: joint -> how it was seen to move. Joints keep the model's origin: its leaves fit there."""
    joints = tuple(
        joint
        if (motion := motions.get(joint.name)) is None
        else joint.model_copy(update={"axis": motion.axis, "upper": max(joint.upper, motion.upper)})
        for joint in model.joints
    )
    return model.model_copy(update={"joints": joints}) if motions else model


def held_under_fixed(bodies: list[BundleBody]) -> list[BundleBody]:
    """Return the bodies, with those fixed that carry what is fixed: a free table under a microwave that hangs in the
    world would be squeezed out between it and the floor."""
    by_name = {body.name: body for body in bodies}
    fixed = [body for body in bodies if not body.movable and body.relation in STANDS]
    carried: dict[str, str] = {}
    while fixed:
        body = fixed.pop()
        carrier = by_name.get(body.parent or "")
        if carrier is not None and carrier.movable and carrier.name not in carried:
            carried[carrier.name] = body.name
            fixed.append(carrier)
    return [
        body.as_held(f"it carries {carried[body.name]}, which stays") if body.name in carried else body
        for body in bodies
    ]


def _surroundings(file: Path) -> BundleBody:
    mesh = read_mesh(file, hint="run `cad` again")
    bounds = box_from_bounds(mesh.bounds[0], mesh.bounds[1])
    origin = _bottom(bounds)
    mesh.apply_translation(-origin[:3, 3])
    return BundleBody(
        name=SURROUNDINGS,
        class_name=NAMELESS,
        parent=None,
        relation="supports",
        world_from_body=origin,
        movable=False,
        box=bounds,
        mesh=mesh,
    )


def _bottom(box: Box) -> np.ndarray:
    """Return a body frame (4, 4) at the bottom of a thing, like that of a CAD model."""
    origin = np.eye(4)
    origin[:3, 3] = np.array(box.center) - [0, 0, 0.5 * box.size[2]]
    return origin


def _mesh(cad_scene: CadScene, node: GraphNode) -> trimesh.Trimesh | None:
    """Return the mesh that stands for a node without model, world frame, or None when there is none."""
    folders = ("shell", "layout") if node.node_type == "layout" else ("meshes",)
    files = [cad_scene.path(folder) / f"{node.id}.ply" for folder in folders]
    file = next((file for file in files if file.is_file()), files[-1])
    if not file.is_file():
        return None
    mesh = read_mesh(file, may_be_empty=True, hint="run `cad` again")
    return mesh if len(mesh.faces) else None


def seen_floors(cad_scene: CadScene) -> list[trimesh.Trimesh]:
    """Return what was seen of the floors of a scene, world frame."""
    floors = [node for node in cad_scene.graph.nodes if node.class_name == "floor"]
    files = [cad_scene.path("layout") / f"{node.id}.ply" for node in floors]
    meshes = [read_mesh(file, may_be_empty=True, hint="run `cad` again") for file in files if file.is_file()]
    return [mesh for mesh in meshes if len(mesh.faces)]


def _box(node: GraphNode, mesh: trimesh.Trimesh | None, cad_scene: CadScene) -> Box:
    if node.box is not None:
        return node.box
    if mesh is None:
        raise BadInput(
            f"{cad_scene.path('graph.json')}: node {node.id} has neither box nor mesh", hint="run `cad` again"
        )
    return box_from_bounds(mesh.bounds[0], mesh.bounds[1])
