"""Write everything of kind interactive_scene: URDF trees, a file per movable body, MJCF, meshes (Han 2024, 2.4.5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import ShellPanel
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.interactive_scene import Doubt, InteractiveSceneFile, SceneBody, Spawn
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.mjcf_file import write_mjcf
from scenewright.stages.kit.formats.scene_light import light_of
from scenewright.stages.kit.formats.scene_links import (
    BodyLinks,
    box_links,
    cut_links,
    door_links,
    furniture_links,
    layout_links,
    mesh_links,
    model_links,
    own_visual,
    still_mesh_links,
    with_inferred,
)
from scenewright.stages.kit.formats.scene_supports import carried_by, resting_height, support_height
from scenewright.stages.kit.formats.urdf_check import NAME, require_sound
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint, write_urdf
from scenewright.stages.kit.geometry.boxes import box_yaw
from scenewright.stages.kit.geometry.layout_slabs import Slab, slabs_of_layout
from scenewright.stages.kit.geometry.substances import substance_of
from scenewright.stages.kit.geometry.transforms import inverse, is_rigid

WORLD = "world"


@dataclass(frozen=True)
class BundleBody:
    """One node of the scene: a posed CAD model, or a mesh of its own (layout, or nothing in the library fits)."""

    name: str
    """Node id of the contact graph."""
    class_name: str
    parent: str | None
    """Name of the body that carries it; None (or `scene`) for those that hang on the world."""
    relation: str
    world_from_body: np.ndarray
    """(4, 4), rigid; the scale is apart."""
    movable: bool
    box: Box
    """World frame."""
    model: CadModel | None = None
    model_folder: Path | None = None
    scale: float = 1.0
    joint_values: dict[str, float] = field(default_factory=dict)
    """The model's joint names -> values at scale 1."""
    held: frozenset[str] = frozenset()
    """Joints of the model that nobody has seen a reason for: their parts stay at their values."""
    part_colors: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)
    """Part of the model -> mean colour that this body's is to have (sRGB, 0 to 255)."""
    mesh: trimesh.Trimesh | None = None
    """Body frame; for bodies without CAD model."""
    reconstructed: np.ndarray | None = None
    """(4, 4) world_from_body before the body came to rest in physics, when it was moved for that."""
    mesh_is_written: bool = False
    """Whether `mesh` lies in the folder already, from an earlier writing of the same scene."""
    mass: float | None = None
    """[kg]; from the model or the volume when None."""
    furniture: bool = False
    """Movable, but nothing that an arm carries."""
    cut: Mapping[int, tuple[np.ndarray, ...]] = field(default_factory=dict)
    """Number of a collision shape of its mesh -> corners (N, 3), body frame, of the convex pieces in its place."""
    inferred: tuple[np.ndarray, ...] = ()
    """Corners (N, 3), body frame [m], of convex pieces that nobody saw, and that its mesh needs to stand."""
    door: ShellPanel | None = None
    """A leaf that turns, where it is one."""
    slabs: tuple[Slab, ...] | None = None
    """World frame: the boxes that a floor, wall or ceiling is; None: those that its planes tell."""
    because: str = ""
    """What of it is inferred and why, or why it is held."""

    def as_held(self, why: str) -> BundleBody:
        """Return the body fixed where it is."""
        return replace(self, movable=False, furniture=False, because=f"held: {why}")


def write_scene_bundle(
    root: Path,
    bodies: list[BundleBody],
    graph: ContactGraphFile,
    spawn: Spawn | None = None,
    doubts: tuple[Doubt, ...] = (),
) -> InteractiveSceneFile:
    """Write kind interactive_scene into `root` and return what stands in scene.json. `spawn`: a place for a robot;
    `doubts`: what nobody should trust.

    `scene.urdf`: every body hangs on its parent, on a floating joint when it is movable, else on a fixed one; joints
    inside articulated models are kept. `static.urdf`: what is not movable, fixed to the nearest ancestor that is
    static too. `bodies/<name>.urdf`: one movable body each. Every file is checked before this returns.

    Raises BadInput for names that are not unique ASCII, missing or cyclic parents, poses that are not rigid, scales
    that are not positive, and for models whose files are broken.
    """
    ordered = _parents_first(_check_bodies(bodies))
    (root / "bodies").mkdir(parents=True, exist_ok=True)
    (root / "meshes").mkdir(exist_ok=True)
    center = _room_center(bodies)
    nodes = {node.id: node for node in graph.nodes}
    links = {body.name: _links(root, body, nodes.get(body.name), graph, center) for body in ordered}
    by_name = {body.name: body for body in ordered}
    static = [body for body in ordered if not body.movable]
    combined = _tree("scene", ordered, links, {body.name: body.parent for body in ordered}, by_name)
    anchors = {body.name: _static_ancestor(body, by_name) for body in static}
    write_urdf(root / "scene.urdf", combined)
    write_urdf(root / "static.urdf", _tree("static", static, links, anchors, by_name))
    checked = [root / "scene.urdf", root / "static.urdf"]
    for body in ordered:
        if body.movable:
            body_links = links[body.name]
            file = root / "bodies" / f"{body.name}.urdf"
            write_urdf(
                file, Urdf(body.name, tuple(_from_subfolder(link) for link in body_links.links), body_links.joints)
            )
            checked.append(file)
    for file in checked:
        require_sound(file, root)
    values = {name: value for body_links in links.values() for name, value in (body_links.joint_values or {}).items()}
    light = light_of([(body.class_name, body.box) for body in ordered])
    base = None if spawn is None else np.array(spawn.world_from_base)
    write_mjcf(root / "scene.mjcf.xml", combined, values, base, lamp=light.position)
    records = tuple(_record(body, links[body.name]) for body in ordered)
    scene = InteractiveSceneFile(bodies=records, spawn=spawn, light=light, doubts=doubts)
    scene.write(root / "scene.json")
    graph.write(root / "graph.json")
    return scene


def _check_bodies(bodies: list[BundleBody]) -> list[BundleBody]:
    names: set[str] = set()
    for body in bodies:
        if not NAME.fullmatch(body.name) or body.name == WORLD or body.name.startswith((".", "-")):
            raise BadInput(f"body name {body.name!r} is not usable in URDF", hint="use ASCII letters, digits and _")
        if body.name in names:
            raise BadInput(f"two bodies are called {body.name!r}", hint="rename one of them")
        names.add(body.name)
        if not is_rigid(body.world_from_body):
            raise BadInput(f"body {body.name}: pose is not a rigid transform", hint="give a rotation and a shift")
        if not (np.isfinite(body.scale) and body.scale > 0):
            raise BadInput(f"body {body.name}: scale is {body.scale}", hint="give a scale over 0")
        if body.mass is not None and not (np.isfinite(body.mass) and body.mass > 0):
            raise BadInput(f"body {body.name}: mass is {body.mass} kg", hint="give a mass over 0")
        if (body.model is None) != (body.model_folder is None):
            raise BadInput(
                f"body {body.name}: a CAD model needs both its record and its folder", hint="give both, or neither"
            )
    return bodies


def _parents_first(bodies: list[BundleBody]) -> list[BundleBody]:
    """Return the bodies in the order given, except that parents precede their children."""
    by_name = {body.name: body for body in bodies}
    ordered: dict[str, BundleBody] = {}

    for body in bodies:
        path: dict[str, BundleBody] = {}
        name: str | None = body.name
        while name not in (None, SCENE_NODE) and name not in ordered:
            if name in path:
                raise BadInput(
                    f"bodies carry each other in a circle: {' -> '.join((*list(path)[-9:], name))}",
                    hint="let the scene carry one of them",
                )
            if name not in by_name:
                raise BadInput(f"body {list(path)[-1]}: parent {name!r} does not exist", hint="name one of the bodies")
            path[name] = by_name[name]
            name = by_name[name].parent
        for carried in reversed(path.values()):
            ordered[carried.name] = carried
    return list(ordered.values())


def _room_center(bodies: list[BundleBody]) -> np.ndarray:
    """Return the middle (3,) of all boxes: the side of a wall on which the room is."""
    if not bodies:
        return np.zeros(3)
    centers = np.array([body.box.center for body in bodies])
    return 0.5 * (centers.min(axis=0) + centers.max(axis=0))


def _links(
    root: Path, body: BundleBody, node: GraphNode | None, graph: ContactGraphFile, center: np.ndarray
) -> BodyLinks:
    substance = substance_of(body.class_name)
    visual = None
    if body.model is None and body.mesh is not None and len(body.mesh.faces):
        visual = own_visual(root, body.name, body.mesh, write=not body.mesh_is_written)
    if body.model is not None and body.model_folder is not None:
        links = model_links(
            root, body.name, body.model, body.model_folder, body.scale, body.joint_values, body.part_colors, body.held
        )
    elif body.door is not None:
        links = door_links(body.name, body.world_from_body, visual, body.door)
    elif load_vocabulary().by_name(body.class_name).is_layout:
        links = layout_links(body.name, body.world_from_body, visual, _slabs(body, node, graph, center))
        return links.with_friction(substance.friction)
    elif body.mesh is not None and visual is not None:
        links = _mesh_links(root, body, body.mesh, visual, substance.hull_density, graph)
        links = with_inferred(root, links, body.inferred)
        links = cut_links(root, links, body.cut) if body.cut else links
    else:
        links = box_links(body.name, body.world_from_body, body.box, substance.hull_density)
    links = links.with_friction(substance.friction)
    return links if body.mass is None else links.with_mass(body.mass)


def _mesh_links(
    root: Path, body: BundleBody, mesh: trimesh.Trimesh, visual: Shape, density: float, graph: ContactGraphFile
) -> BodyLinks:
    nodes = {node.id: node for node in graph.nodes}
    pose = body.world_from_body
    if body.movable:
        carried = carried_by(graph, nodes, body.name)
        is_in_pieces = body.furniture or bool(carried)
        height = (support_height if is_in_pieces else resting_height)(graph, nodes, body.name)
        before = pose if body.reconstructed is None else body.reconstructed
        rests_at = None if height is None else height - float(before[2, 3])
        if is_in_pieces:
            return furniture_links(
                root,
                body.name,
                mesh,
                visual,
                density,
                before,
                rests_at=rests_at,
                carried=carried,
                inferred=body.inferred,
            )
        return mesh_links(root, body.name, mesh, visual, density, rests_at=rests_at)
    yaw = float(box_yaw(body.box) - np.arctan2(pose[1, 0], pose[0, 0]))
    return still_mesh_links(body.name, mesh, visual, density, pose, yaw, carried_by(graph, nodes, body.name))


def _slabs(body: BundleBody, node: GraphNode | None, graph: ContactGraphFile, center: np.ndarray) -> list[Slab]:
    if body.slabs is not None:
        return list(body.slabs)
    planes = () if node is None else node.planes
    in_world = None
    if body.mesh is not None and len(body.mesh.faces):
        in_world = body.mesh.copy()
        in_world.apply_transform(body.world_from_body)
    return slabs_of_layout(body.name, body.class_name, planes, body.box, in_world, graph, center)


def _static_ancestor(body: BundleBody, by_name: dict[str, BundleBody]) -> str | None:
    parent = body.parent
    while parent not in (None, SCENE_NODE) and by_name[parent].movable:
        parent = by_name[parent].parent
    return parent


def _tree(
    name: str,
    bodies: list[BundleBody],
    links: dict[str, BodyLinks],
    parents: dict[str, str | None],
    by_name: dict[str, BundleBody],
) -> Urdf:
    """Return the kinematic tree of bodies under the link `world`; `parents`: body -> body that it hangs on, or None."""
    all_links, joints = [Link(WORLD)], []
    for body in bodies:
        parent = parents[body.name]
        world_from_parent = np.eye(4)
        if parent in (None, SCENE_NODE):
            parent = WORLD
        else:
            world_from_parent = by_name[parent].world_from_body
        body_links = links[body.name]
        joints.append(
            UrdfJoint(
                name=f"{body.name}__support",
                type="floating" if body.movable else "fixed",
                parent=parent,
                child=body.name,
                parent_from_child=inverse(world_from_parent) @ body.world_from_body,
            )
        )
        all_links.extend(body_links.links)
        joints.extend(body_links.joints)
    return Urdf(name, tuple(all_links), tuple(joints))


def _from_subfolder(link: Link) -> Link:
    """Return the link with mesh paths as seen from bodies/."""

    def moved(shape: Shape) -> Shape:
        return shape if shape.mesh is None else replace(shape, mesh=f"../{shape.mesh}")

    return replace(
        link,
        visuals=tuple(moved(shape) for shape in link.visuals),
        collisions=tuple(moved(shape) for shape in link.collisions),
    )


def _record(body: BundleBody, links: BodyLinks) -> SceneBody:
    model = body.model
    width = None if model is None or model.grasp_width is None else model.grasp_width * body.scale
    return SceneBody(
        name=body.name,
        class_name=body.class_name,
        movable=body.movable,
        furniture=body.furniture,
        file=f"bodies/{body.name}.urdf" if body.movable else None,
        parent=None if body.parent == SCENE_NODE else body.parent,
        relation=body.relation,
        world_from_body=as_transform(body.world_from_body),
        joints=links.joint_records,
        joint_values=links.joint_values or {},
        box=body.box,
        mass=links.mass,
        contains=model.contains if model is not None else False,
        grasp_width=width,
        because=body.because,
        world_from_reconstructed=None if body.reconstructed is None else as_transform(body.reconstructed),
    )
