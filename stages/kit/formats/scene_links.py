"""Turn one body of a scene into links, internal joints and mesh files (scaled CAD model, own mesh, or layout slabs)."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.cad_library import CadModel
from scenewright.schemas.cad_scene import ShellPanel
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Box, Joint
from scenewright.stages.kit.formats.cad_models import URDF_FILE, load_visual_parts
from scenewright.stages.kit.formats.model_writer import HINGE_DAMPING, HINGE_FRICTION, write_obj
from scenewright.stages.kit.formats.part_colors import recolored_shapes, vertex_colors
from scenewright.stages.kit.formats.scene_supports import (
    Carried,
    cut_below,
    furniture_pieces,
    levelled,
    pads,
    standing_points,
)
from scenewright.stages.kit.formats.urdf_file import Link, Shape, UrdfJoint, parse_urdf
from scenewright.stages.kit.geometry.box_cover import cover_with_boxes
from scenewright.stages.kit.geometry.layout_slabs import Slab, slabs_of_panel
from scenewright.stages.kit.geometry.solids import MassProperties, Solid, box, hull_or_box, mass_properties
from scenewright.stages.kit.geometry.transforms import (
    inverse,
    transform_from,
    transform_from_quaternion,
    transform_from_yaw,
)
from scipy.spatial.transform import Rotation

DOOR_DENSITY, OPENS = 400.0, 1.5708
"""Of a door's leaf [kg/m^3], and how far it opens at least [rad]; by eye."""
LAYOUT_DENSITY = 1000.0
"""Density of floor, walls and ceiling [kg/m^3]; by eye."""
GREY = (0.6, 0.6, 0.6, 1.0)
"""Colour of links without one (RGBA, 0 to 1)."""
INFERRED = (0.55, 0.35, 0.85, 1.0)
"""Colour of what nobody saw (RGBA, 0 to 1)."""
URDF_MESHES = (".obj", ".stl")
"""What every loader of URDF reads; pybullet refuses a whole file that names a GLB."""


@dataclass(frozen=True)
class BodyLinks:
    """Links of one body (first the body's own), the joints among them, and the joints for scene.json."""

    links: tuple[Link, ...]
    joints: tuple[UrdfJoint, ...] = ()
    joint_records: tuple[Joint, ...] = ()
    joint_values: dict[str, float] | None = None

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return sum(link.inertial.mass for link in self.links if link.inertial is not None)

    def with_mass(self, mass: float) -> BodyLinks:
        """Return the same body with its total mass set to `mass` [kg], shares and shape of inertia kept."""
        ratio = mass / self.mass
        links = []
        for link in self.links:
            before = link.inertial
            after = (
                None if before is None else MassProperties(before.mass * ratio, before.center, before.inertia * ratio)
            )
            links.append(replace(link, inertial=after))
        return replace(self, links=tuple(links))

    def with_friction(self, friction: float) -> BodyLinks:
        """Return the same body with the sliding friction of all links set that have none of their own."""
        links = tuple(link if link.friction is not None else replace(link, friction=friction) for link in self.links)
        return replace(self, links=links)


def model_links(
    root: Path,
    name: str,
    model: CadModel,
    folder: Path,
    scale: float,
    values: dict[str, float],
    part_colors: Mapping[str, tuple[int, int, int]] | None = None,
    held: Collection[str] = (),
) -> BodyLinks:
    """Return the links of a CAD model under uniform scaling, and copy its meshes to `root`/meshes/<model id>/.

    Lengths and prismatic limits grow with the scale, angles stay, mass grows with its cube, inertia with its fifth
    power. `part_colors`: part -> mean colour (sRGB, 0..255) that it is to have; `held`: joints that do not
    move, whose parts are fixed at their values. Axes and limits are `model`'s, which may know more than its file.
    Raises BadInput for a model folder without a sound URDF, or whose meshes lie outside.
    """
    urdf = parse_urdf(folder / URDF_FILE)
    names = {part: name if k == 0 else f"{name}__{part}" for k, part in enumerate(model.parts)}
    missing = set(names) - {link.name for link in urdf.links}
    if missing:
        raise BadInput(f"{folder / URDF_FILE}: no link {sorted(missing)[0]!r}", hint="build the CAD library again")
    links = []
    for part in model.parts:
        link = urdf.link(part)
        visuals = tuple(_copy_shape(root, model.id, part, folder, shape, scale, visual=True) for shape in link.visuals)
        if part_colors and part in part_colors:
            visuals = recolored_shapes(root, name, visuals, part_colors[part])
        collisions = tuple(
            _copy_shape(root, model.id, part, folder, shape, scale, visual=False) for shape in link.collisions
        )
        inertial = None if link.inertial is None else link.inertial.scaled(scale)
        links.append(Link(names[part], inertial, visuals, collisions, link.friction))
    by_name = {joint.name: joint for joint in urdf.joints}
    joints, records, placed = [], [], {}
    for record in model.joints:
        if record.parent == model.parts[0]:  # says the same as saying nothing
            record = record.model_copy(update={"parent": None})
        length = scale if record.type == "prismatic" else 1.0
        source = by_name.get(record.name)
        if source is None:
            raise BadInput(f"{folder / URDF_FILE}: no joint {record.name!r}", hint="build the CAD library again")
        frame = source.parent_from_child.copy()
        frame[:3, 3] *= scale
        value = float(np.clip(values.get(record.name, 0.0), record.lower, record.upper)) * length
        if record.name in held:
            frame = frame @ _moved(record, value)
            parent, child = names[record.parent or model.parts[0]], names[record.part]
            joints.append(UrdfJoint(f"{name}__{record.name}", "fixed", parent, child, frame))
            continue
        joints.append(
            replace(
                source,
                name=f"{name}__{record.name}",
                parent=names[record.parent or model.parts[0]],
                child=names[record.part],
                parent_from_child=frame,
                axis=source.axis if np.allclose(source.axis, record.axis, atol=1e-5) else record.axis,
                lower=record.lower * length,
                upper=record.upper * length,
            )
        )
        records.append(scaled_joint(record, name, scale))
        placed[f"{name}__{record.name}"] = value
    return BodyLinks(tuple(links), tuple(joints), tuple(records), placed)


def _moved(joint: Joint, value: float) -> np.ndarray:
    """Return (4, 4): how a part's frame moves with its joint's value [rad, m]; it is parallel to the model's at 0."""
    axis = np.asarray(joint.axis)
    if joint.type == "prismatic":
        return transform_from(np.eye(3), value * axis)
    return transform_from(Rotation.from_rotvec(value * axis).as_matrix(), np.zeros(3))


def scaled_joint(joint: Joint, body: str, scale: float) -> Joint:
    """Return the joint of a model as it is in a scene: prefixed names, lengths times `scale`, angles unchanged."""
    length = scale if joint.type == "prismatic" else 1.0

    def grown(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return (point[0] * scale, point[1] * scale, point[2] * scale)

    return joint.model_copy(
        update={
            "name": f"{body}__{joint.name}",
            "part": f"{body}__{joint.part}",
            "parent": None if joint.parent is None else f"{body}__{joint.parent}",
            "origin": grown(joint.origin),
            "lower": joint.lower * length,
            "upper": joint.upper * length,
            "handle": None if joint.handle is None else grown(joint.handle),
        }
    )


def _copy_shape(
    root: Path, model_id: str, part: str, folder: Path, shape: Shape, scale: float, *, visual: bool
) -> Shape:
    frame = shape.link_from_shape.copy()
    frame[:3, 3] *= scale
    if shape.box_size is not None:
        x, y, z = (float(v) * scale for v in shape.box_size)
        return replace(shape, box_size=(x, y, z), link_from_shape=frame)
    source = (folder / (shape.mesh or "")).resolve()
    if not source.is_relative_to(folder.resolve()) or not source.is_file():
        raise BadInput(
            f"{folder / URDF_FILE}: mesh {shape.mesh!r} is not a file of the model folder",
            hint="build the CAD library again",
        )
    relative = source.relative_to(folder.resolve())
    if relative.suffix.lower() not in URDF_MESHES:
        relative = relative.with_suffix(".obj")
    target = root / "meshes" / model_id / relative
    color = shape.color
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.suffix == source.suffix:
            shutil.copyfile(source, target)
        else:
            mesh = load_visual_parts(folder)[part]
            write_obj(target, mesh.vertices, mesh.faces, vertex_colors(mesh))
    if visual and color is None:
        color = _mean_color(load_visual_parts(folder).get(part))
    return Shape(target.relative_to(root).as_posix(), shape.scale * scale, None, frame, color)


def mesh_links(
    root: Path, name: str, mesh: trimesh.Trimesh, visual: Shape, density: float, *, rests_at: float | None = None
) -> BodyLinks:
    """Return the link of a movable thing without CAD model: `visual` to look at, the convex hull of its mesh (body
    frame) to collide with, filled at `density` [kg/m^3].

    The hull is flat where the thing rests, at the height `rests_at` [m] of the body frame; too flat for a hull, it is
    the box around it, at least 5 mm thick.
    """
    points = np.asarray(mesh.vertices, dtype=float)
    solid, properties = _hull(points if rests_at is None else standing_points(points, rests_at), density)
    write_obj(root / "meshes" / name / "collision_0.obj", solid.vertices, solid.faces)
    return BodyLinks((Link(name, properties, (visual,), (Shape(f"meshes/{name}/collision_0.obj"),)),))


def furniture_links(
    root: Path,
    name: str,
    mesh: trimesh.Trimesh,
    visual: Shape,
    density: float,
    world_from_body: np.ndarray,
    *,
    rests_at: float | None,
    carried: Sequence[Carried] = (),
    inferred: Sequence[np.ndarray] = (),
) -> BodyLinks:
    """Return the link of furniture without CAD model: `visual` to look at, convex pieces of its mesh (body frame) to
    collide with, weighing what the hull of it all weighs at `density` [kg/m^3].

    None reaches below `rests_at` [m], body frame. Pieces are cut level below what it carries (`world_from_body`: where
    it was reconstructed), and a pad lies under each of these. What nobody saw of it (`inferred`: corners (N, 3) of
    convex pieces) weighs as the rest does, and is added by `with_inferred`.
    """
    points = np.asarray(mesh.vertices, dtype=float)
    properties = _hull(np.concatenate([points, *inferred]), density)[1]
    pieces = furniture_pieces(points, np.asarray(mesh.faces), rests_at)
    pieces = cut_below(pieces, world_from_body, carried)
    solids = [_hull(piece, density)[0] for piece in pieces]
    collisions = _pads_of(world_from_body, carried)
    for number, solid in enumerate(solids):
        write_obj(root / "meshes" / name / f"collision_{number}.obj", solid.vertices, solid.faces)
        collisions.append(Shape(f"meshes/{name}/collision_{number}.obj"))
    solids += [hull_or_box(corners) for corners in inferred]
    visuals = (visual, *_shown_pads(world_from_body, carried))
    links = BodyLinks((Link(name, mass_properties(solids, [density] * len(solids)), visuals, tuple(collisions)),))
    return links.with_mass(properties.mass)


def still_mesh_links(
    name: str,
    mesh: trimesh.Trimesh,
    visual: Shape,
    density: float,
    world_from_body: np.ndarray,
    yaw: float,
    carried: Sequence[Carried],
) -> BodyLinks:
    """Return the link of a thing without CAD model that stays where it is: `visual` to look at, boxes over the surface
    of its mesh (body frame), turned by `yaw` [rad], to collide with, so that what lies in it or under it is free.

    The boxes are level below what it carries.
    """
    properties = _hull(np.asarray(mesh.vertices, dtype=float), density)[1]
    turned = transform_from_yaw(yaw, np.zeros(3))
    collisions = []
    for center, size in levelled(cover_with_boxes(mesh, yaw), yaw, world_from_body, carried):
        frame = turned.copy()
        frame[:3, 3] = turned[:3, :3] @ center
        collisions.append(Shape(box_size=_triple(size), link_from_shape=frame))
    collisions += _pads_of(world_from_body, carried)
    return BodyLinks((Link(name, properties, (visual, *_shown_pads(world_from_body, carried)), tuple(collisions)),))


def with_inferred(root: Path, links: BodyLinks, inferred: Sequence[np.ndarray]) -> BodyLinks:
    """Return the one link of a thing with its mesh, and convex pieces, corners (N, 3) in its frame, to collide with and
    to look at, in the colour of what nobody saw."""
    if not inferred:
        return links
    link, visuals, collisions = links.links[0], list(links.links[0].visuals), list(links.links[0].collisions)
    for number, corners in enumerate(inferred):
        file, solid = f"meshes/{link.name}/inferred_{number}.obj", hull_or_box(corners)
        write_obj(root / file, solid.vertices, solid.faces)
        visuals.append(Shape(file, color=INFERRED))
        collisions.append(Shape(file))
    return replace(links, links=(replace(link, visuals=tuple(visuals), collisions=tuple(collisions)),))


def cut_links(root: Path, links: BodyLinks, cut: Mapping[int, Sequence[np.ndarray]]) -> BodyLinks:
    """Return the one link of a thing with its mesh with convex pieces, corners (N, 3) in its frame, in the place of
    some of its collision shapes, by their number. Where that is all of them, its mass lies where they are."""
    link, mass = links.links[0], links.mass
    collisions, solids = [], []
    for number, shape in enumerate(link.collisions):
        for part, corners in enumerate(cut.get(number, ())):
            solids.append(_hull(corners, LAYOUT_DENSITY)[0])
            file = f"meshes/{link.name}/cut_{number}_{part}.obj"
            write_obj(root / file, solids[-1].vertices, solids[-1].faces)
            collisions.append(Shape(file))
        collisions += [] if number in cut else [shape]
    is_whole = len(cut) == len(link.collisions)
    inertial = mass_properties(solids, [LAYOUT_DENSITY] * len(solids)) if is_whole else link.inertial
    return replace(links, links=(replace(link, inertial=inertial, collisions=tuple(collisions)),)).with_mass(mass)


def _pads_of(world_from_body: np.ndarray, carried: Sequence[Carried]) -> list[Shape]:
    """Return a flat box below each carried thing, body frame."""
    body_from_world, shapes = inverse(world_from_body), []
    for center, size, world_yaw in pads(carried):
        frame = body_from_world @ transform_from_yaw(world_yaw, center)
        shapes.append(Shape(box_size=_triple(size), link_from_shape=frame))
    return shapes


def _shown_pads(world_from_body: np.ndarray, carried: Sequence[Carried]) -> list[Shape]:
    """Return the pads whose planes nobody saw, to look at."""
    return [replace(shape, color=INFERRED) for shape in _pads_of(world_from_body, [c for c in carried if c.hidden])]


def _hull(points: np.ndarray, density: float) -> tuple[Solid, MassProperties]:
    """Return the convex hull of points (N, 3), or the box around them when they are flatter than 2 mm, and its mass."""
    solid = hull_or_box(points)
    return solid, mass_properties([solid], [density])


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def box_links(name: str, world_from_body: np.ndarray, bounds: Box, density: float) -> BodyLinks:
    """Return the link of a thing of which only the box (world frame) is known, filled at `density` [kg/m^3]."""
    frame = inverse(world_from_body) @ transform_from_quaternion(
        np.asarray(bounds.orientation), np.asarray(bounds.center)
    )
    x, y, z = (max(float(v), 5e-3) for v in bounds.size)
    solid = box((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2)).moved(frame)
    shape = Shape(box_size=(x, y, z), link_from_shape=frame, color=GREY)
    return BodyLinks((Link(name, mass_properties([solid], [density]), (shape,), (replace(shape, color=None),)),))


def layout_links(name: str, world_from_body: np.ndarray, visual: Shape | None, slabs: list[Slab]) -> BodyLinks:
    """Return the link of a floor, wall or ceiling: `visual` (None: the slabs) to look at, slabs to collide with."""
    body_from_world = inverse(world_from_body)
    collisions, solids = [], []
    for slab in slabs:
        frame = body_from_world @ slab.world_from_slab
        x, y, z = (float(v) for v in slab.size)
        collisions.append(Shape(box_size=(x, y, z), link_from_shape=frame))
        solids.append(box((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2)).moved(frame))
    properties = mass_properties(solids, [LAYOUT_DENSITY] * len(solids)) if solids else None
    visuals = tuple(replace(shape, color=GREY) for shape in collisions) if visual is None else (visual,)
    return BodyLinks((Link(name, properties, visuals, tuple(collisions)),))


def door_links(name: str, world_from_body: np.ndarray, visual: Shape | None, door: ShellPanel) -> BodyLinks:
    """Return the links of a door of the shell: one that stays, without a shape, and the leaf, which turns about one of
    its upright edges. `visual` (None: its box): the shut leaf, body frame."""
    hinge, slabs = door.hinge, slabs_of_panel(door)
    assert hinge is not None  # who calls asks first
    edge = np.eye(4)
    edge[0, 3] = min(box[0] for box in door.boxes) if hinge.at_left else max(box[2] for box in door.boxes)
    body_from_leaf = inverse(world_from_body) @ np.array(door.world_from_panel) @ edge
    leaf_from_body = inverse(body_from_leaf)
    collisions, solids = [], []
    for slab in slabs:
        frame = leaf_from_body @ inverse(world_from_body) @ slab.world_from_slab
        x, y, z = (float(v) for v in slab.size)
        collisions.append(Shape(box_size=(x, y, z), link_from_shape=frame))
        solids.append(box((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2)).moved(frame))
    visuals = [replace(shape, color=GREY) for shape in collisions]
    if visual is not None:
        visuals = [replace(visual, link_from_shape=leaf_from_body)]
    leaf, axis = f"{name}__leaf", (0.0, -1.0 if hinge.at_left else 1.0, 0.0)
    properties = mass_properties(solids, [DOOR_DENSITY] * len(solids))
    limits = min(0.0, hinge.angle), max(OPENS, hinge.angle)
    joint = UrdfJoint(f"{name}__hinge", "revolute", name, leaf, body_from_leaf, axis, *limits)
    joint = replace(joint, damping=HINGE_DAMPING, friction=HINGE_FRICTION)
    record = Joint(
        name=joint.name,
        type="revolute",
        part=leaf,
        origin=_triple(body_from_leaf[:3, 3]),
        axis=_triple(body_from_leaf[:3, :3] @ np.array(axis)),
        lower=limits[0],
        upper=limits[1],
    )
    links = (Link(name), Link(leaf, properties, tuple(visuals), tuple(collisions)))
    return BodyLinks(links, (joint,), (record,), {joint.name: hinge.angle})


def own_visual(root: Path, name: str, mesh: trimesh.Trimesh, *, write: bool) -> Shape:
    """Return the mesh of a body (body frame) as a visual shape; `write`: into `root`/meshes/`name`/, too."""
    folder = root / "meshes" / name
    if write:
        folder.mkdir(parents=True, exist_ok=True)
        write_obj(folder / "visual.obj", mesh.vertices, mesh.faces, vertex_colors(mesh))
    return Shape(f"meshes/{name}/visual.obj", color=_mean_color(mesh))


def _mean_color(mesh: trimesh.Trimesh | None) -> tuple[float, float, float, float]:
    colors = None if mesh is None else vertex_colors(mesh)
    if colors is None or len(colors) == 0:
        return GREY
    red, green, blue = (float(v) for v in np.round(colors.mean(axis=0) / 255.0, 4))
    return (red, green, blue, 1.0)
