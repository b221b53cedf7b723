"""A scene as an SDF world: a model a body, with the mesh files that it names beside it.

Still bodies are static models. A body with doors is fixed to the world by a joint. SDF knows no joint values: links
stand where they were reconstructed and limits count from there.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scenewright.stages.export.scene_bodies import BodyToExport, SceneToExport
from scenewright.stages.export.scene_registry import Written
from scenewright.stages.kit.formats.urdf_file import Link, Shape, UrdfJoint, number, numbers
from scenewright.stages.kit.geometry.substances import SPINNING_FRICTION
from scenewright.stages.kit.geometry.transforms import inverse
from scipy.spatial.transform import Rotation

VERSION = "1.9"
LAMP = (0.0, 0.0, 3.0)
"""Where it hangs in scenes that do not say [m]."""


def write(folder: Path, scene: SceneToExport) -> Written:
    """Write scene.sdf and meshes/ into `folder`. The same scene gives the same bytes."""
    root = Element("sdf", version=VERSION)
    world = SubElement(root, "world", name="scene")
    SubElement(world, "gravity").text = "0 0 -9.81"
    _add_lamp(world, scene)
    for body in scene.bodies:
        world.append(_model(body, scene))
    ElementTree.indent(root, " ")
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    (folder / "scene.sdf").write_bytes(text)
    _copy_meshes(scene, folder)
    values = scene.written.joint_values
    names = {body.name for body in scene.bodies}
    for body in scene.bodies:
        names |= {link.name for link in body.links} | {joint.name for joint in body.joints}
    return Written(
        names={allowed(name): name for name in sorted(names) if allowed(name) != name},
        joint_zero={name: value for name, value in sorted(values.items()) if value},
    )


def _add_lamp(world: Element, scene: SceneToExport) -> None:
    light = scene.written.info.light
    lamp = SubElement(world, "light", name="lamp", type="point")
    SubElement(lamp, "pose").text = f"{numbers(LAMP if light is None else light.position)} 0 0 0"
    SubElement(lamp, "diffuse").text = "0.9 0.9 0.9 1"
    fades = SubElement(lamp, "attenuation")
    for name, value in (("range", "30"), ("constant", "0.6"), ("linear", "0.05"), ("quadratic", "0.01")):
        SubElement(fades, name).text = value


def allowed(name: str) -> str:
    """Return a name that SDF allows: it keeps `__...__` and `world` for itself."""
    return f"of_{name}" if name == "world" or (name.startswith("__") and name.endswith("__")) else name


def _model(body: BodyToExport, scene: SceneToExport) -> Element:
    model = Element("model", name=allowed(body.name))
    world_from_model = scene.pose(body.links[0])
    _pose(model, world_from_model)
    if not body.dynamic:
        SubElement(model, "static").text = "1"  # Bullet does not know `true`
    for link in body.links:
        model.append(_link(link, inverse(world_from_model) @ scene.pose(link), dynamic=body.dynamic))
    if body.dynamic and not body.record.movable:
        joint = SubElement(model, "joint", name=f"{body.name}__to_the_world", type="fixed")
        SubElement(joint, "parent").text = "world"
        SubElement(joint, "child").text = allowed(body.links[0].name)
    for entry in body.joints:
        model.append(_joint(entry, scene.written.joint_values.get(entry.name, 0.0)))
    return model


def _pose(parent: Element, pose: np.ndarray) -> None:
    angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", suppress_warnings=True)
    SubElement(parent, "pose").text = f"{numbers(pose[:3, 3])} {numbers(angles)}"


def _link(link: Link, model_from_link: np.ndarray, *, dynamic: bool) -> Element:
    element = Element("link", name=allowed(link.name))
    _pose(element, model_from_link)
    if dynamic and link.inertial is not None:
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "pose").text = f"{numbers(link.inertial.center)} 0 0 0"
        SubElement(inertial, "mass").text = number(link.inertial.mass)
        tensor = SubElement(inertial, "inertia")
        for row, column in ("xx", "xy", "xz", "yy", "yz", "zz"):
            value = link.inertial.inertia["xyz".index(row), "xyz".index(column)]
            SubElement(tensor, f"i{row}{column}").text = f"{value:.9g}"
    for count, shape in enumerate(link.visuals):
        visual = SubElement(element, "visual", name=f"visual_{count}")
        _geometry(visual, shape)
        if shape.color is not None:
            material = SubElement(visual, "material")
            for light in ("ambient", "diffuse"):
                SubElement(material, light).text = numbers(np.round(shape.color, 4))
    for count, shape in enumerate(link.collisions):
        collision = SubElement(element, "collision", name=f"collision_{count}")
        _geometry(collision, shape)
        if link.friction is not None:
            _surface(collision, link.friction)
    return element


def _surface(collision: Element, friction: float) -> None:
    """Of two surfaces in contact, the smaller value counts."""
    entry = SubElement(SubElement(collision, "surface"), "friction")
    ode = SubElement(entry, "ode")
    SubElement(ode, "mu").text = SubElement(ode, "mu2").text = number(friction)
    SubElement(SubElement(entry, "torsional"), "coefficient").text = number(SPINNING_FRICTION)


def _geometry(parent: Element, shape: Shape) -> None:
    _pose(parent, shape.link_from_shape)
    geometry = SubElement(parent, "geometry")
    if shape.box_size is not None:
        SubElement(SubElement(geometry, "box"), "size").text = numbers(shape.box_size)
        return
    mesh = SubElement(geometry, "mesh")
    SubElement(mesh, "uri").text = shape.mesh
    if shape.scale != 1.0:
        SubElement(mesh, "scale").text = numbers((shape.scale,) * 3)


def _joint(joint: UrdfJoint, value: float) -> Element:
    element = Element("joint", name=allowed(joint.name), type=joint.type)
    SubElement(element, "parent").text = allowed(joint.parent)
    SubElement(element, "child").text = allowed(joint.child)
    if joint.type == "fixed":
        return element
    axis = SubElement(element, "axis")
    SubElement(axis, "xyz").text = numbers(joint.axis)
    if joint.type != "continuous":
        limit = SubElement(axis, "limit")
        SubElement(limit, "lower").text = number(joint.lower - value)
        SubElement(limit, "upper").text = number(joint.upper - value)
    dynamics = SubElement(axis, "dynamics")
    SubElement(dynamics, "damping").text = number(joint.damping)
    SubElement(dynamics, "friction").text = number(joint.friction)
    return element


def _copy_meshes(scene: SceneToExport, folder: Path) -> None:
    shapes = (shape for body in scene.bodies for link in body.links for shape in (*link.visuals, *link.collisions))
    for name in sorted({shape.mesh for shape in shapes if shape.mesh is not None}):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(scene.written.root / name, target)
