"""Models of strangers: nothing that a file holds is skipped in silence.

What the file means is MuJoCo's own compilation for MJCF, and closed form for the others. A reader may also say in a
finding, by the element's name, that it did not read it.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh

from tests.strangers.importing import add, hinge, is_size, like_mujoco, right_or_named, write
from tests.unit.ingest.tiny_room import png

BODY = '<geom name="carcass" type="box" pos="0 0 0.3" size="0.2 0.15 0.3"/>'
DOOR = (
    '<joint name="hinge" type="hinge" axis="0 0 1" range="0 90"/>'
    '<geom name="leaf" type="box" pos="0.2 -0.01 0" size="0.2 0.01 0.28"/>'
)
DOOR_BODY = f'<body name="door" pos="-0.2 -0.15 0.3">{DOOR}</body>'
"""A cabinet of 0.40 x 0.32 x 0.60 m whose door turns about (-0.2, -0.14, 0.3) of the model."""


def mjcf(path: Path, world: str, before: str = "", after: str = "") -> Path:
    return write(path, f'<mujoco model="cabinet">{before}<worldbody>{world}</worldbody>{after}</mujoco>')


def obj(path: Path, mesh: trimesh.Trimesh) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path)
    return path


# ---- MJCF ------------------------------------------------------------------------------------------------------------


def test_mjcf_as_it_should_be(tmp_path: Path) -> None:
    """The plain cabinet, so that the tests below mean something: MuJoCo's size and hinge."""
    path = mjcf(tmp_path / "in" / "cabinet.xml", f'<body name="cabinet">{BODY}{DOOR_BODY}</body>')
    model = add(tmp_path / "in", tmp_path / "out").only
    like_mujoco(path)(model)
    is_size(model, 0.40, 0.32, 0.60)
    hinge(model, "hinge", (-0.2, -0.14, 0.3), (0, 0, 1))


@pytest.mark.parametrize("nested", [False, True])
def test_mjcf_replicate(tmp_path: Path, nested: bool) -> None:
    """Boards of a shelf by <replicate>, also one in another (google-deepmind/dm_control #495,
    newton-physics/mujoco-usd-converter #87): the height of all of them, or `replicate` is named."""
    board = '<geom type="box" size="0.3 0.15 0.01" pos="0 0 0.01"/>'
    if nested:
        board = f'<replicate count="2" offset="0.6 0 0">{board}</replicate>'
    rows = f'<replicate count="5" offset="0 0 0.3">{board}</replicate>'
    path = mjcf(
        tmp_path / "in" / "shelf.xml",
        f'<body name="shelf"><geom type="box" size="0.01 0.15 0.05" pos="-0.3 0 0.05"/>{rows}</body>',
    )
    right_or_named(add(tmp_path / "in", tmp_path / "out"), like_mujoco(path), "replicate")


def test_mjcf_attach(tmp_path: Path) -> None:
    """The door is a model of its own that <attach> hangs on (google-deepmind/mujoco #2162,
    newton-physics/mujoco-usd-converter #79): MuJoCo's size and hinge, or `attach` is named."""
    write(
        tmp_path / "in" / "parts" / "door.xml",
        f'<mujoco model="leaf"><worldbody><body name="door">{DOOR}</body></worldbody></mujoco>',
    )
    path = mjcf(
        tmp_path / "in" / "cabinet.xml",
        f'<body name="cabinet">{BODY}<frame pos="-0.2 -0.15 0.3"><attach model="leaf" body="door" prefix="left_"/>'
        "</frame></body>",
        before='<asset><model name="leaf" file="parts/door.xml"/></asset>',
    )
    added = add(tmp_path / "in", tmp_path / "out")
    assert len(added.models) <= 1 or added.names("attach"), f"the part is a model by itself: {added.text}"
    right_or_named(added, like_mujoco(path), "attach")


def test_mjcf_include_inside_a_body(tmp_path: Path) -> None:
    """<include> stands inside of a body (google-deepmind/dm_control #529): MuJoCo's size and hinge."""
    write(tmp_path / "in" / "door.xml", f"<mujocoinclude>{DOOR_BODY}</mujocoinclude>")
    path = mjcf(tmp_path / "in" / "cabinet.xml", f'<body name="cabinet">{BODY}<include file="door.xml"/></body>')
    right_or_named(add(tmp_path / "in", tmp_path / "out"), like_mujoco(path), "include")


def test_mjcf_bodies_in_two_files(tmp_path: Path) -> None:
    """The scene has a table of its own and includes the cabinet, whose file has a <worldbody> too
    (strands-labs/robots #2668): both models, each once."""
    mjcf(tmp_path / "in" / "parts" / "cabinet.xml", f'<body name="cabinet">{BODY}{DOOR_BODY}</body>')
    mjcf(
        tmp_path / "in" / "scene.xml",
        '<body name="table" pos="2 0 0"><geom type="box" pos="0 0 0.35" size="0.5 0.3 0.35"/></body>',
        before='<include file="parts/cabinet.xml"/>',
    )
    added = add(tmp_path / "in", tmp_path / "out")
    assert sorted(model["class_name"] for model in added.models) == ["cabinet", "table"], added.text
    (cabinet,) = [model for model in added.models if model["class_name"] == "cabinet"]
    is_size(cabinet, 0.40, 0.32, 0.60)
    hinge(cabinet, "hinge", (-0.2, -0.14, 0.3), (0, 0, 1))


def test_mjcf_box_that_is_fitted_to_a_mesh(tmp_path: Path) -> None:
    """type="box" with a mesh means the box of the same inertia, not the mesh (newton-physics/newton #776): MuJoCo's
    size, or the geom is named."""
    carcass = trimesh.creation.cylinder(0.2, 0.6)
    carcass.apply_translation([0.0, 0.0, 0.3])
    obj(tmp_path / "in" / "meshes" / "carcass.obj", carcass)
    path = mjcf(
        tmp_path / "in" / "cabinet.xml",
        '<body name="cabinet"><geom name="carcass" type="box" mesh="carcass"/></body>',
        before='<compiler meshdir="meshes"/><asset><mesh name="carcass" file="carcass.obj"/></asset>',
    )
    right_or_named(add(tmp_path / "in", tmp_path / "out"), like_mujoco(path), "fit|mesh.*box|box.*mesh|'carcass'")


def test_mjcf_geom_without_a_type(tmp_path: Path) -> None:
    """A geom without a type is a sphere, whatever numbers its size has (strands-labs/robots #3267): MuJoCo's size."""
    path = mjcf(
        tmp_path / "in" / "cabinet.xml",
        f'<body name="cabinet">{BODY}<geom name="knob" pos="0 -0.15 0.5" size="0.03 0.2 0.2"/></body>',
    )
    right_or_named(add(tmp_path / "in", tmp_path / "out"), like_mujoco(path), "knob|size")


COUPLED = (
    f'<body name="cabinet">{BODY}'
    '<body name="left" pos="-0.2 -0.15 0.3"><joint name="left_hinge" axis="0 0 1" range="-90 0"/>'
    '<geom type="box" pos="0.1 -0.01 0" size="0.1 0.01 0.28"/></body>'
    '<body name="right" pos="0.2 -0.15 0.3"><joint name="right_hinge" axis="0 0 1" range="0 90"/>'
    '<geom type="box" pos="-0.1 -0.01 0" size="0.1 0.01 0.28"/></body></body>'
)


@pytest.mark.parametrize(
    ("rest", "word"),
    [
        (
            '<tendon><fixed name="rod"><joint joint="left_hinge" coef="1"/><joint joint="right_hinge" coef="1"/>'
            "</fixed>"
            '</tendon><equality><tendon tendon1="rod"/></equality>',
            "tendon|equality|coupl",
        ),
        (
            '<equality><weld body1="left" body2="cabinet"/></equality>'
            '<equality><joint joint1="left_hinge" joint2="right_hinge" polycoef="0 -1 0 0 0"/></equality>',
            "equality|coupl|weld",
        ),
        ('<equality><connect body1="left" body2="right" anchor="0.2 0 0"/></equality>', "equality|connect"),
    ],
    ids=["tendon", "two sections", "connect"],
)
def test_mjcf_couplings(tmp_path: Path, rest: str, word: str) -> None:
    """Two doors that a tendon, an equality in a second section, or a closed loop couples: two free hinges are not the
    whole of it, so a finding says so (newton-physics/newton #1406, #3679, #2665)."""
    mjcf(tmp_path / "in" / "cabinet.xml", COUPLED, after=rest)
    added = add(tmp_path / "in", tmp_path / "out")
    assert added.names(word), added.text


def test_mjcf_composite(tmp_path: Path) -> None:
    """A cushion by <flexcomp> or a curtain by <composite>: the element is named (deformables of
    newton-physics/mujoco-usd-converter #87's model folder)."""
    mjcf(
        tmp_path / "in" / "sofa.xml",
        '<body name="sofa"><geom type="box" pos="0 0 0.2" size="0.9 0.4 0.2"/>'
        '<flexcomp name="cushion" type="grid" count="3 3 3" spacing="0.2 0.2 0.2" pos="0 0 0.8" dim="3" radius="0.01" '
        'mass="1"/></body>',
    )
    added = add(tmp_path / "in", tmp_path / "out")
    assert added.names("flexcomp|cushion"), added.text


# ---- SDF -------------------------------------------------------------------------------------------------------------


def sdf(path: Path, inner: str, version: str) -> Path:
    return write(path, f'<sdf version="{version}"><model name="cabinet">{inner}</model></sdf>')


def box(size: str, pose: str = "0 0 0 0 0 0") -> str:
    geometry = f"<geometry><box><size>{size}</size></box></geometry>"
    return "".join(f'<{kind} name="{kind}"><pose>{pose}</pose>{geometry}</{kind}>' for kind in ("collision", "visual"))


CARCASS = f'<link name="carcass"><pose>0 0 0.3 0 0 0</pose>{box("0.4 0.3 0.6")}</link>'
LIMIT = "<limit><lower>0</lower><upper>1.57</upper></limit>"


def hinged(kind: str = "revolute", axis: str = "<xyz>0 0 1</xyz>", pose: str = "") -> str:
    return (
        f'<joint name="hinge" type="{kind}">{pose}<parent>carcass</parent><child>door</child>'
        f"<axis>{axis}{LIMIT}</axis></joint>"
    )


def is_the_cabinet(model: dict[str, Any]) -> None:
    is_size(model, 0.40, 0.32, 0.60)
    hinge(model, "hinge", (-0.2, -0.14, 0.3), (0, 0, 1))


def test_sdf_as_it_should_be(tmp_path: Path) -> None:
    """The plain cabinet, so that the tests below mean something."""
    door = f'<link name="door"><pose>-0.2 -0.15 0.3 0 0 0</pose>{box("0.4 0.02 0.56", "0.2 -0.01 0 0 0 0")}</link>'
    sdf(tmp_path / "in" / "cabinet.sdf", CARCASS + door + hinged(), "1.7")
    is_the_cabinet(add(tmp_path / "in", tmp_path / "out").only)


def test_sdf_pose_in_degrees(tmp_path: Path) -> None:
    """<pose degrees="true"> of SDF 1.9: the door's box is turned by 90 deg, not rad (gazebosim/sdformat #252)."""
    shape = box("0.02 0.4 0.56", "0.2 -0.01 0 0 0 90").replace("<pose>", '<pose degrees="true">')
    door = f'<link name="door"><pose>-0.2 -0.15 0.3 0 0 0</pose>{shape}</link>'
    sdf(tmp_path / "in" / "cabinet.sdf", CARCASS + door + hinged(), "1.9")
    right_or_named(add(tmp_path / "in", tmp_path / "out"), is_the_cabinet, "degrees")


def test_sdf_pose_as_a_quaternion(tmp_path: Path) -> None:
    """<pose rotation_format="quat_xyzw"> with seven numbers (gazebosim/sdformat #690): turned by 90 deg about z."""
    half = np.sqrt(0.5)
    shape = box("0.02 0.4 0.56", f"0.2 -0.01 0 0 0 {half} {half}").replace(
        "<pose>", '<pose rotation_format="quat_xyzw">'
    )
    door = f'<link name="door"><pose>-0.2 -0.15 0.3 0 0 0</pose>{shape}</link>'
    sdf(tmp_path / "in" / "cabinet.sdf", CARCASS + door + hinged(), "1.9")
    right_or_named(add(tmp_path / "in", tmp_path / "out"), is_the_cabinet, "rotation_format|quat")


@pytest.mark.parametrize(
    ("kind", "more"), [("universal", "<axis2><xyz>1 0 0</xyz></axis2>"), ("screw", "<thread_pitch>-100</thread_pitch>")]
)
def test_sdf_joints_of_other_kinds(tmp_path: Path, kind: str, more: str) -> None:
    """A universal joint (gazebosim/gz-usd #45) and a screw (RobotLocomotion/drake #12404): the joint or its kind is
    named, and the model is not simply stiff."""
    door = f'<link name="door"><pose>-0.2 -0.15 0.3 0 0 0</pose>{box("0.4 0.02 0.56", "0.2 -0.01 0 0 0 0")}</link>'
    joint = hinged(kind).replace("</joint>", f"{more}</joint>")
    sdf(tmp_path / "in" / "cabinet.sdf", CARCASS + door + joint, "1.7")
    added = add(tmp_path / "in", tmp_path / "out")
    assert added.names(f"hinge|{kind}"), added.text


ROUND = {
    "capsule": "<capsule><radius>0.05</radius><length>0.5</length></capsule>",
    "ellipsoid": "<ellipsoid><radii>0.05 0.05 0.3</radii></ellipsoid>",
}


@pytest.mark.parametrize("shape", ROUND)
def test_sdf_shapes_since_version_1_8(tmp_path: Path, shape: str) -> None:
    """A table's leg is a capsule of 0.60 m or an ellipsoid of it (gazebosim/gz-usd #41): the table is 0.65 m high, or
    the shape or its kind is named."""
    geometry = f"<geometry>{ROUND[shape]}</geometry>"
    leg = "".join(f'<{k} name="leg_{k}"><pose>0 0 0.3 0 0 0</pose>{geometry}</{k}>' for k in ("collision", "visual"))
    top = box("0.8 0.6 0.05", "0 0 0.625 0 0 0")
    write(
        tmp_path / "in" / "table.sdf",
        f'<sdf version="1.8"><model name="table"><link name="table">{top}{leg}</link></model></sdf>',
    )
    right_or_named(
        add(tmp_path / "in", tmp_path / "out"), lambda model: is_size(model, 0.8, 0.6, 0.65), f"{shape}|leg_visual"
    )


def test_sdf_polyline(tmp_path: Path) -> None:
    """An outline that is extruded (bulletphysics/bullet3 #1645): 0.40 x 0.30 x 0.60, or the shape or its kind is
    named."""
    corners = ("-0.2 -0.15", "0.2 -0.15", "0.2 0.15", "-0.2 0.15")
    outline = "".join(f"<point>{point}</point>" for point in corners)
    geometry = f"<geometry><polyline>{outline}<height>0.6</height></polyline></geometry>"
    shapes = "".join(f'<{kind} name="{kind}">{geometry}</{kind}>' for kind in ("collision", "visual"))
    foot = box("0.1 0.1 0.02", "0 0 0.01 0 0 0").replace('name="', 'name="foot_')
    sdf(tmp_path / "in" / "cabinet.sdf", f'<link name="carcass">{shapes}{foot}</link>', "1.6")
    right_or_named(
        add(tmp_path / "in", tmp_path / "out"),
        lambda model: is_size(model, 0.4, 0.3, 0.6),
        "polyline|shape of link 'visual'",
    )


def test_sdf_submesh(tmp_path: Path) -> None:
    """One mesh file holds carcass and door, each link takes its <submesh> (gazebo-web/gzweb #2): the door's link is
    the door alone, so opening it swings 0.40 m forward and nothing backward, or `submesh` is named."""
    carcass, leaf = trimesh.creation.box((0.4, 0.3, 0.6)), trimesh.creation.box((0.4, 0.02, 0.56))
    carcass.apply_translation([0, 0, 0.3])
    leaf.apply_translation([0, -0.16, 0.3])
    lines, first = [], 1
    for name, mesh in (("carcass", carcass), ("door", leaf)):
        lines += [f"o {name}", *(f"v {x} {y} {z}" for x, y, z in mesh.vertices)]
        lines += [f"f {a + first} {b + first} {c + first}" for a, b, c in mesh.faces]
        first += len(mesh.vertices)
    write(tmp_path / "in" / "meshes" / "cabinet.obj", "\n".join(lines) + "\n")

    def part(name: str, pose: str) -> str:
        geometry = (
            f"<geometry><mesh><uri>meshes/cabinet.obj</uri><submesh><name>{name}</name><center>false</center>"
            "</submesh></mesh></geometry>"
        )
        shapes = "".join(
            f'<{kind} name="{kind}"><pose>{pose}</pose>{geometry}</{kind}>' for kind in ("collision", "visual")
        )
        return shapes

    links = (
        f'<link name="carcass">{part("carcass", "0 0 0 0 0 0")}</link>'
        f'<link name="door"><pose>-0.2 -0.15 0.3 0 0 0</pose>{part("door", "0.2 0.15 -0.3 0 0 0")}</link>'
    )
    sdf(tmp_path / "in" / "cabinet.sdf", links + hinged(axis="<xyz>0 0 -1</xyz>"), "1.7")

    def right(model: dict[str, Any]) -> None:
        is_the_cabinet(model)
        low, high = (np.array([state[name] for state in model["states"]]) for name in ("box_minimum", "box_maximum"))
        assert high[:, 1].max() < 0.17 and low[:, 1].min() < -0.5 and high[:, 0].max() < 0.25

    right_or_named(add(tmp_path / "in", tmp_path / "out"), right, "submesh")


def test_sdf_use_parent_model_frame_in_a_later_version(tmp_path: Path) -> None:
    """The element means nothing since 1.7 (gazebosim/sdformat #327): the axis is the joint's (0, -1, 0 turned by the
    child: the model's z), or the element is named."""
    door = (
        f'<link name="door"><pose>-0.2 -0.15 0.3 1.5707963267948966 0 0</pose>'
        f"{box('0.4 0.56 0.02', '0.2 0 0.01 0 0 0')}</link>"
    )
    axis = "<xyz>0 1 0</xyz><use_parent_model_frame>1</use_parent_model_frame>"
    sdf(tmp_path / "in" / "cabinet.sdf", CARCASS + door + hinged(axis=axis), "1.7")
    right_or_named(add(tmp_path / "in", tmp_path / "out"), is_the_cabinet, "use_parent_model_frame")


# ---- URDF ------------------------------------------------------------------------------------------------------------


def urdf_box(size: str, xyz: str) -> str:
    geometry = f'<origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry>'
    return f"<visual>{geometry}</visual><collision>{geometry}</collision>"


def test_urdf_planar_joint(tmp_path: Path) -> None:
    """A tray that slides in a plane (RobotLocomotion/drake #18730): the joint or its kind is named, not welded in
    silence."""
    write(
        tmp_path / "in" / "table.urdf",
        f'<robot name="table"><link name="table">{urdf_box("0.8 0.6 0.7", "0 0 0.35")}</link>'
        f'<link name="tray">{urdf_box("0.3 0.2 0.02", "0 0 0.01")}</link>'
        '<joint name="glide" type="planar"><parent link="table"/><child link="tray"/><origin xyz="0 0 0.7"/>'
        '<axis xyz="0 0 1"/></joint></robot>',
    )
    added = add(tmp_path / "in", tmp_path / "out")
    assert added.names("glide|planar"), added.text


def test_urdf_in_which_a_gazebo_block_holds_the_other_shape(tmp_path: Path) -> None:
    """A lid that is only in an <sdf>-like block of <gazebo> is no part of the URDF: the size without it (ros/urdfdom
    #192 keeps to the standard's elements)."""
    write(
        tmp_path / "in" / "cabinet.urdf",
        f'<robot name="cabinet"><link name="carcass">{urdf_box("0.4 0.3 0.6", "0 0 0.3")}</link>'
        '<gazebo reference="carcass"><visual><geometry><box size="2 2 2"/></geometry></visual></gazebo></robot>',
    )
    is_size(add(tmp_path / "in", tmp_path / "out").only, 0.4, 0.3, 0.6)


# ---- glTF ------------------------------------------------------------------------------------------------------------


def glb(path: Path, document: dict[str, Any], binary: bytes) -> Path:
    """Write a binary glTF of a document and one buffer."""
    document = {"asset": {"version": "2.0"}, "scene": 0, **document, "buffers": [{"byteLength": len(binary)}]}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def packed(*arrays: np.ndarray) -> tuple[list[dict[str, int]], bytes]:
    """Return buffer views of arrays, each at a multiple of 4, and the buffer."""
    views, data = [], b""
    for array in arrays:
        data += b"\0" * (-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data += array.tobytes()
    return views, data


def block(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(bounds=(low, high))
    return mesh.vertices.astype("<f4"), mesh.faces.astype("<u2")


def test_gltf_quantized(tmp_path: Path) -> None:
    """KHR_mesh_quantization: positions are int16, the node's scale makes metres of them (f3d-app/f3d #2473,
    DassaultSystemes-Technology/dspbr-pt #33): 0.6 x 0.4 x 0.72 (y of the file is up), or the extension is named."""
    points, faces = block((-0.3, 0.0, -0.2), (0.3, 0.72, 0.2))
    whole = np.zeros((len(points), 4), "<i2")
    whole[:, :3] = np.rint(points / 0.72 * 32767)
    views, data = packed(whole, faces)
    views[0]["byteStride"] = 8
    accessors = [
        {"bufferView": 0, "componentType": 5122, "normalized": True, "count": len(points), "type": "VEC3",
         "min": whole[:, :3].min(axis=0).tolist(), "max": whole[:, :3].max(axis=0).tolist()},
        {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
    ]  # fmt: skip
    document = {
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [0.72, 0.72, 0.72]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors,
        "bufferViews": views,
    }
    glb(tmp_path / "in" / "table.glb", document, data)
    right_or_named(
        add(tmp_path / "in", tmp_path / "out"), lambda model: is_size(model, 0.6, 0.4, 0.72), "KHR_mesh_quantization"
    )


def simple(points: np.ndarray, faces: np.ndarray, *more: np.ndarray) -> tuple[dict[str, Any], bytes]:
    """Return a document of one mesh, its further arrays as the next buffer views, and the buffer."""
    views, data = packed(points, faces, *more)
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
         "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()},
        {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
    ]  # fmt: skip
    return {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors,
        "bufferViews": views,
    }, data


@pytest.mark.parametrize("required", [True, False])
def test_gltf_instances(tmp_path: Path, required: bool) -> None:
    """EXT_mesh_gpu_instancing: four legs, one mesh (atteneder/glTFast #107, zeux/meshoptimizer #685): a table of
    0.85 x 0.65 x 0.75, or the extension is named."""
    top, top_faces = block((-0.4, 0.7, -0.3), (0.4, 0.75, 0.3))
    leg, leg_faces = block((-0.025, 0.0, -0.025), (0.025, 0.7, 0.025))
    places = np.array([(x, 0, z) for x in (-0.4, 0.4) for z in (-0.3, 0.3)], "<f4")
    document, data = simple(top, top_faces, leg, leg_faces, places)
    document["accessors"] += [
        {"bufferView": 2, "componentType": 5126, "count": len(leg), "type": "VEC3",
         "min": leg.min(axis=0).tolist(), "max": leg.max(axis=0).tolist()},
        {"bufferView": 3, "componentType": 5123, "count": leg_faces.size, "type": "SCALAR"},
        {"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC3"},
    ]  # fmt: skip
    document["meshes"].append({"primitives": [{"attributes": {"POSITION": 2}, "indices": 3}]})
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 4}}}
    document["nodes"].append({"mesh": 1, "extensions": extension})
    document["scenes"] = [{"nodes": [0, 1]}]
    document["extensionsUsed"] = list(extension)
    if required:
        document["extensionsRequired"] = list(extension)
    glb(tmp_path / "in" / "table.glb", document, data)
    right_or_named(
        add(tmp_path / "in", tmp_path / "out"),
        lambda model: is_size(model, 0.85, 0.65, 0.75),
        "EXT_mesh_gpu_instancing",
    )


@pytest.mark.parametrize("extension", ["KHR_texture_transform", "EXT_texture_webp"])
def test_gltf_extensions_that_change_colours_alone(tmp_path: Path, extension: str) -> None:
    """A required extension of textures (RobotLocomotion/drake #23183, gltf-rs/gltf #431, f3d-app/f3d #2473): the
    size and the colour are right. The picture is green on the left and red on the right; the mesh shows the left, and
    the transform moves it by half of the picture."""
    points, faces = block((-0.3, 0.0, -0.2), (0.3, 0.72, 0.2))
    uv = np.full((len(points), 2), (0.3, 0.5), "<f4")
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:, :4], pixels[:, 4:] = (40, 200, 40), (200, 40, 40)
    kind = "webp" if extension == "EXT_texture_webp" else "png"
    picture = np.frombuffer(cv2.imencode(f".{kind}", pixels[..., ::-1])[1].tobytes(), np.uint8)
    document, data = simple(points, faces, uv, picture)
    document["accessors"].append({"bufferView": 2, "componentType": 5126, "count": len(uv), "type": "VEC2"})
    document["meshes"][0]["primitives"][0] |= {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": 0}
    document |= {"images": [{"bufferView": 3, "mimeType": f"image/{kind}"}], "textures": [{"source": 0}]}
    texture: dict[str, Any] = {"index": 0}
    if extension == "KHR_texture_transform":
        texture["extensions"] = {extension: {"offset": [0.5, 0.0]}}
    else:
        document["textures"] = [{"extensions": {extension: {"source": 0}}}]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": texture}}]
    document |= {"extensionsUsed": [extension], "extensionsRequired": [extension]}
    glb(tmp_path / "in" / "table.glb", document, data)
    added = add(tmp_path / "in", tmp_path / "out")
    is_size(added.only, 0.6, 0.4, 0.72)
    assert colors_of(tmp_path / "out") == {"g" if kind == "webp" else "r"}, added.text


def test_gltf_compressed_with_a_fallback(tmp_path: Path) -> None:
    """Draco is used and not required, the accessors hold the plain mesh too (mikedh/trimesh #2101 is of those that
    require it): the size is right."""
    points, faces = block((-0.3, 0.0, -0.2), (0.3, 0.72, 0.2))
    document, data = simple(points, faces, np.zeros(16, np.uint8))
    draco = {"KHR_draco_mesh_compression": {"bufferView": 2, "attributes": {"POSITION": 0}}}
    document["meshes"][0]["primitives"][0]["extensions"] = draco
    document["extensionsUsed"] = list(draco)
    glb(tmp_path / "in" / "table.glb", document, data)
    right_or_named(
        add(tmp_path / "in", tmp_path / "out"),
        lambda model: is_size(model, 0.6, 0.4, 0.72),
        "KHR_draco_mesh_compression",
    )


def test_gltf_strips(tmp_path: Path) -> None:
    """A primitive of mode 5 beside one of triangles: 0.6 x 0.4 x 1.0, or strips are named (o3de/o3de #16724)."""
    points, faces = block((-0.3, 0.0, -0.2), (0.3, 0.72, 0.2))
    # A board on top as one strip: two triangles at the height of 1 m, upright.
    strip = np.array([[-0.3, 0.72, 0.0], [0.3, 0.72, 0.0], [-0.3, 1.0, 0.0], [0.3, 1.0, 0.0]], "<f4")
    document, data = simple(points, faces, strip)
    document["accessors"].append(
        {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3", "min": strip.min(axis=0).tolist(),
         "max": strip.max(axis=0).tolist()}
    )  # fmt: skip
    document["meshes"][0]["primitives"].append({"attributes": {"POSITION": 2}, "mode": 5})
    glb(tmp_path / "in" / "table.glb", document, data)
    right_or_named(add(tmp_path / "in", tmp_path / "out"), lambda model: is_size(model, 0.6, 0.4, 1.0), "strip|mode")


# ---- OBJ -------------------------------------------------------------------------------------------------------------

CORNERS = [(x, y, z) for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (0.0, 0.72)]
QUADS = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]


def table_is_right(model: dict[str, Any]) -> None:
    is_size(model, 0.6, 0.4, 0.72)


def test_obj_line_continuation(tmp_path: Path) -> None:
    """A backslash goes on in the next line, in v and in f (mikedh/trimesh #1103, assimp/assimp #1200):
    0.6 x 0.4 x 0.72, or the line is named."""
    vertices = "\n".join(f"v {x} {y} \\\n {z}" for x, y, z in CORNERS)
    faces = "\n".join("f " + quad.replace(" ", " \\\n ", 2) for quad in QUADS)
    write(tmp_path / "in" / "table.obj", f"{vertices}\n{faces}\n")
    added = add(tmp_path / "in", tmp_path / "out", "--up", "+z", "--unit", "m")
    right_or_named(added, table_is_right, r"backslash|continu|\\|line \d+")


def test_obj_lines_and_points_beside_faces(tmp_path: Path) -> None:
    """l and p elements of a modeller beside the faces (mrdoob/three.js #8283, #9204): the faces' size."""
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in [*CORNERS, (5, 5, 5), (6, 6, 6)])
    faces = "\n".join(f"f {quad}" for quad in QUADS)
    write(tmp_path / "in" / "table.obj", f"o table\n{vertices}\nl 9 10\np 9\ng grp1\n{faces}\nf 9\n")
    added = add(tmp_path / "in", tmp_path / "out", "--up", "+z", "--unit", "m")
    right_or_named(added, table_is_right, r"line|point")


def test_obj_free_form_surface(tmp_path: Path) -> None:
    """A carcass of faces whose top is a free-form `surf` (tinyobjloader/tinyobjloader #178 is of such elements): the
    element is named, for the surface is lost."""
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in CORNERS)
    faces = "\n".join(f"f {quad}" for quad in QUADS)
    top = "v -0.3 -0.2 1\nv 0.3 -0.2 1\nv -0.3 0.2 1\nv 0.3 0.2 1\ncstype bezier\ndeg 1 1\nsurf 0 1 0 1 9 10 11 12\n"
    write(tmp_path / "in" / "table.obj", f"{vertices}\n{faces}\n{top}parm u 0 1\nparm v 0 1\nend\n")
    added = add(tmp_path / "in", tmp_path / "out", "--up", "+z", "--unit", "m")
    assert added.names("surf|free.?form|bezier"), added.text


def colors_of(folder: Path) -> set[str]:
    """Return the names of the strongest channels of what is drawn."""
    found = set()
    for file in folder.rglob("*.glb"):
        mesh = trimesh.load(file, force="mesh")
        for color in np.unique(np.asarray(mesh.visual.vertex_colors)[:, :3], axis=0):
            if np.ptp(color.astype(int)) > 30:
                found.add("rgb"[int(np.argmax(color))])
    return found


def test_obj_map_with_options(tmp_path: Path) -> None:
    """map_Kd has options before the file's name (tinyobjloader/tinyobjloader #178): the picture's red, or the file is
    named."""
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in CORNERS)
    faces = "\n".join("f " + " ".join(f"{number}/1" for number in quad.split()) for quad in QUADS)
    folder = tmp_path / "in"
    write(folder / "table.obj", f"mtllib table.mtl\n{vertices}\nvt 0.5 0.5\nusemtl wood\n{faces}\n")
    write(folder / "table.mtl", "newmtl wood\nKd 1 1 1\nmap_Kd -s 2.0 2.0 1.0 -o 0 0 0 wood.png\n")
    (folder / "wood.png").write_bytes(png(np.full((8, 8, 3), (200, 30, 30), np.uint8)))
    added = add(folder, tmp_path / "out", "--up", "+z", "--unit", "m")
    table_is_right(added.only)
    if colors_of(tmp_path / "out") != {"r"}:
        assert added.names(r"wood\.png|map_Kd") and not added.names(r"-s 2\.0.*not there"), added.text
