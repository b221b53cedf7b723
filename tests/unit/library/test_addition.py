"""`library add`: every format, its unit, up axis, front and joints; bad files; merging; the same bytes again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.cli.main import run as command_line
from scenewright.schemas.cad_library import CadLibrary, CadModel, ImportedModel, ImportFile
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.kit.formats.cad_models import (
    load_collision_parts,
    model_folder,
    part_transforms,
    posed_mesh,
    read_model,
)
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.geometry.file_axes import AXES
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.stage import Context
from scenewright.stages.library.addition import run
from scenewright.stages.library.importing.classes import class_of
from scenewright.stages.library.importing.collada_file import parse_collada
from scenewright.stages.library.importing.discovery import Unread, find_models
from scenewright.stages.library.importing.frames import model_rotation
from scenewright.stages.library.importing.pieces import convex_pieces
from scenewright.stages.library.importing.placing import normal_limits
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import Surface, painted_faces
from scenewright.stages.library.importing.versions import coacd_version, uses_coacd
from scenewright.stages.library.parameters import AdditionParameters

from tests.real_data import real_data


def add(
    folder: Path, output: Path, library: CadLibrary | None = None, mapping: str = "", **parameters: object
) -> CadLibrary:
    output.mkdir(parents=True)
    table = None
    if mapping:
        table = output.parent / f"{output.name}.toml"
        table.write_text(mapping)
    context = Context(output=output, seed=0, device="cpu", progress=SilentProgress())
    settled = AdditionParameters(**{"decomposition": "hulls", **parameters})
    return run(folder, library, table, parameters=settled, context=context)


def only(library: CadLibrary) -> tuple[CadModel, ImportedModel]:
    (model,) = library.info.models
    (record,) = ImportFile.read(library.path("imports.json")).models
    folder = model_folder(library, model.id)
    assert read_model(folder) == model
    assert check_urdf(folder / "model.urdf") == []
    return model, record


def size_of(model: CadModel) -> np.ndarray:
    state = model.states[0]
    return np.asarray(state.box_maximum) - np.asarray(state.box_minimum)


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def obj_box(path: Path, size: tuple[float, float, float]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(size).export(path)
    return path


URDF = """
<?xml version="0.0" ?>
<robot name="thing"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"/>
<link name="carcass"><inertial><mass value="10"/></inertial>
 <visual><origin xyz="0 0 0.4"/><geometry><mesh filename="package://a/parts/carcass.obj" scale="0.01 0.01 0.01"/>
 </geometry><material name="red"/></visual></link>
<link name="drawer"><visual><geometry><box size="0.2 0.5 0.2"/></geometry></visual></link>
<link name="drawer handle"><visual><geometry><box size="0.02 0.1 0.02"/></geometry></visual></link>
<link name="door"><visual><origin xyz="0 0.25 0"/><geometry><box size="0.02 0.5 0.3"/></geometry></visual>
 <collision><origin xyz="0 0.25 0"/><geometry><cylinder radius="0.2" length="0.3"/></geometry></collision></link>
<joint name="root" type="fixed"><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><parent link="base"/>
 <child link="carcass"/></joint>
<joint name="slide" type="prismatic"><origin xyz="0.15 0 0.65"/><parent link="carcass"/><child link="drawer"/>
 <axis xyz="-1 0 0"/><limit lower="-0.3" upper="0" effort="1" velocity="1"/></joint>
<joint name="grip" type="fixed"><origin xyz="0.11 0 0"/><parent link="drawer"/><child link="drawer handle"/></joint>
<joint name="hinge" type="revolute"><origin xyz="0.31 -0.25 0.2"/><parent link="carcass"/><child link="door"/>
 <axis xyz="0 0 1"/><limit lower="0.0" upper="1.5" effort="1" velocity="1"/></joint>
</robot>"""


def urdf_cabinet(folder: Path) -> Path:
    obj_box(folder / "parts" / "carcass.obj", (60.0, 50.0, 80.0))
    return write(folder / "old_cabinet.urdf", URDF)


def test_urdf_keeps_its_joints(tmp_path) -> None:
    urdf_cabinet(tmp_path / "in")
    library = add(tmp_path / "in", tmp_path / "out")
    model, record = only(library)
    assert (model.class_name, model.id, record.joints) == ("cabinet", "old_cabinet", 2)
    assert model.mass == pytest.approx(
        10.0 * (1 + (0.2 * 0.5 * 0.2 + 0.02 * 0.1 * 0.02 + _cylinder()) / 0.24), rel=1e-3
    )
    # The file's front is where drawer and door lie: +x of the carcass, which its fixed joint turns to +y of the root.
    assert record.front == "+y" and record.front_from == "joints"
    np.testing.assert_allclose(size_of(model), [0.5, 0.62, 0.8], atol=1e-6)
    slide, hinge = model.joints
    assert (slide.type, slide.lower, slide.upper) == ("prismatic", 0.0, 0.3)
    np.testing.assert_allclose(slide.axis, [0, -1, 0], atol=1e-9)
    assert slide.handle is not None
    np.testing.assert_allclose(np.abs(slide.handle_axis), [1, 0, 0], atol=1e-6)
    assert (hinge.type, hinge.lower, hinge.upper) == ("revolute", 0.0, 1.5)
    np.testing.assert_allclose(hinge.axis, [0, 0, 1], atol=1e-9)
    # Across, the model is from 0.30 behind the carcass frame to 0.32 before it; the hinge is 0.31 before.
    np.testing.assert_allclose(hinge.origin, [-0.25, -0.30, 0.2], atol=1e-6)
    assert record.can_be_opened and record.can_contain and record.can_support and record.has_handle
    assert not record.can_be_carried
    (uses,) = library.info.affordances
    assert [(use.joint, use.kind) for use in uses.joints] == [("slide", "drawer"), ("hinge", "door")]
    assert uses.openable == ("slide", "hinge") and not uses.movable and not uses.contains  # its drawer is solid
    assert uses.carries[0].part == "body" and [grasp.joint for grasp in uses.grasps] == ["slide"]
    opened = posed_mesh(model_folder(library, model.id), model, {"slide": 0.3, "hinge": 0.0})
    assert opened.bounds[0][1] == pytest.approx(-(0.27 + 0.3 - 0.01), abs=1e-6)
    colors = posed_mesh(model_folder(library, model.id), model, {}).visual.vertex_colors
    assert (np.asarray(colors)[:, :3] == [255, 0, 0]).all(axis=1).any()


def _cylinder() -> float:
    angle = 2 * np.pi / 24
    return 12 * 0.2**2 * np.sin(angle) * 0.3


def test_a_unit_is_that_of_the_mesh_files_of_a_description(tmp_path) -> None:
    urdf_cabinet(tmp_path / "in")
    metres, _ = only(add(tmp_path / "in", tmp_path / "a"))
    tenth, record = only(add(tmp_path / "in", tmp_path / "b", unit="dm"))
    assert (record.unit, record.unit_from) == (0.1, "option")
    hinges = [joint.origin[2] for joint in (*metres.joints, *tenth.joints) if joint.type == "revolute"]
    assert [joint.upper for joint in tenth.joints] == [joint.upper for joint in metres.joints]
    # the carcass is 0.08 high about 0.4 now, and the hinge still 0.2 above the carcass frame
    bottom = 0.2 - 0.15  # of the door, which is a box of 0.3 in metres
    assert hinges == [pytest.approx(0.2), pytest.approx(0.2 - bottom)]


def test_a_description_without_meshes_is_in_the_unit_that_is_said(tmp_path) -> None:
    folder = tmp_path / "in"
    body = '<link name="a"><visual><geometry><box size="400 300 600"/></geometry></visual></link>'
    door = '<link name="b"><visual><origin xyz="200 0 0"/><geometry><box size="400 20 600"/></geometry></visual></link>'
    hinge = (
        '<joint name="j" type="{}"><origin xyz="-200 -160 0"/><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    )
    text = f'<robot>{body}{door}{hinge}<limit lower="0" upper="100"/></joint></robot>'
    write(folder / "cabinet.urdf", text.format("prismatic"))
    model, record = only(add(folder, tmp_path / "out", unit="mm"))
    np.testing.assert_allclose(size_of(model), [0.4, 0.32, 0.6], atol=1e-6)
    assert model.joints[0].upper == pytest.approx(0.1) and (record.unit, record.unit_from) == (0.001, "option")


MJCF = """<mujoco model="hutch"><compiler angle="{angle}" eulerseq="xyz"/><include file="../renamed/sub/assets.xml"/>
<worldbody><body name="cabinet" pos="0.1 0.2 0.3" euler="0 0 {turn}" childclass="wood">
<geom type="box" size="0.3 0.25 0.4"/>
<body name="door" pos="0.3 -0.25 0" quat="0.9238795325112867 0 0 0.3826834323650898">
 <joint name="hinge" range="{low} {high}" pos="0.01 0 0" axis="0 0 -1"/>
 <geom name="panel" type="box" size="0.01 0.2 0.3" pos="0.02 0.2 0"/>
 <geom name="grip" type="capsule" fromto="0.05 0.3 -0.1 0.05 0.3 0.1" size="0.01"/>
 <site name="pull" pos="0.05 0.3 0"/></body>
<body name="tray" pos="0 -0.2 -0.2"><joint class="slides" name="tray_slide" range="0.05 0.3" axis="0 -1 0"/>
 <geom type="box" size="0.2 0.05 0.05"/></body>
</body></worldbody></mujoco>"""
ASSETS = """<mujocoinclude><default><default class="wood"><geom rgba="0.5 0.4 0.3 1" mass="1"/><joint limited="true"/>
<default class="slides"><joint type="slide"/></default></default></default></mujocoinclude>"""


def mjcf_cabinet(folder: Path, angle: str) -> Path:
    factor = 1.0 if angle == "radian" else 180 / np.pi
    write(folder / "sub" / "assets.xml", ASSETS)
    text = MJCF.format(angle=angle, turn=0.5 * factor, low=-0.2 * factor, high=1.2 * factor)
    return write(folder / "hutch.xml", text)


@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_mjcf_angles_defaults_and_includes(tmp_path, angle) -> None:
    mjcf_cabinet(tmp_path / "in", angle)
    model, record = only(add(tmp_path / "in", tmp_path / "out", front="-y"))
    hinge, slide = model.joints
    assert (hinge.type, slide.type) == ("revolute", "prismatic")
    assert hinge.lower == pytest.approx(-0.2) and hinge.upper == pytest.approx(1.2)
    assert (slide.lower, slide.upper) == (0.0, pytest.approx(0.25))
    assert hinge.handle is not None and np.abs(hinge.handle_axis).argmax() == 2
    assert model.mass == pytest.approx(4.0)
    assert any("files are named elsewhere" in finding for finding in record.findings)


def test_mjcf_moves_as_in_mujoco(tmp_path) -> None:
    """Second implementation: where MuJoCo puts the door's and the tray's boxes, relative to the carcass."""
    mujoco = pytest.importorskip("mujoco")
    path = mjcf_cabinet(tmp_path / "in", "degree")
    library = add(tmp_path / "in", tmp_path / "out", front="-y")
    model, _ = only(library)
    simulated = mujoco.MjModel.from_xml_string(
        path.read_text().replace("../renamed/sub/assets.xml", "assets.xml"), {"assets.xml": ASSETS.encode()}
    )
    data = mujoco.MjData(simulated)
    pieces = load_collision_parts(model_folder(library, model.id))
    carcass = pieces["body"][0].vertices.mean(axis=0)
    for hinge_value, slide_value in ((0.0, 0.05), (1.1, 0.3), (-0.2, 0.2)):
        data.qpos[:] = [hinge_value, slide_value]
        mujoco.mj_forward(simulated, data)
        poses = part_transforms(model, {"hinge": hinge_value, "tray_slide": slide_value - 0.05})
        for part, geom in (("door", 1), ("tray", 3)):
            panel = max(pieces[part], key=lambda mesh: mesh.volume).vertices.mean(axis=0)
            here = apply(poses[part], panel[None])[0] - carcass
            np.testing.assert_allclose(here, data.geom_xpos[geom] - data.geom_xpos[0], atol=1e-6)


DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 1 0 1</color></diffuse>
</lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">{points}</float_array>
<technique_common><accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="6" material="s"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 4 4 4 4 4</vcount>
<p>0 1 3 2 4 6 7 5 0 4 5 1 2 3 7 6 0 2 6 4 1 5 7 3</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="same"><node id="same"><translate>5 6 7</translate><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="s" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#same"/></scene></COLLADA>"""


def dae(unit: float, up: str, size: tuple[float, float, float]) -> str:
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * np.asarray(size)
    return DAE.format(unit=unit, up=up, points=" ".join(f"{v:g}" for v in corners.ravel()))


def test_sdf_takes_the_unit_of_its_dae(tmp_path) -> None:
    folder = tmp_path / "in" / "robomaker_Table_01"
    write(folder / "meshes" / "table.DAE", dae(0.01, "Z_UP", (160.0, 80.0, 75.0)))
    sdf = """<sdf version="1.6"><model name="robomaker_Table_01"><link name="link"><inertial><mass>12</mass></inertial>
    <visual name="v"><geometry><mesh><uri>model://robomaker_Table_01/meshes/table.DAE</uri></mesh></geometry></visual>
    <collision name="c"><pose>0.8 0.4 0.7 0 0 0</pose><geometry><box><size>1.6 0.8 0.1</size></box></geometry>
    </collision></link><link name="flap"><pose>0.8 0 0.75 0 0 0</pose><visual name="v"><geometry><box>
    <size>0.3 0.3 0.02</size></box></geometry></visual></link>
    <joint name="fold" type="revolute"><parent>link</parent><child>flap</child><pose>0 -0.15 0 0 0 0</pose>
    <axis><xyz>1 0 0</xyz><limit><lower>-1.5</lower><upper>0</upper></limit></axis></joint>
    </model></sdf>"""
    write(folder / "model.sdf", sdf)
    model, record = only(add(tmp_path / "in", tmp_path / "out", front="-y"))
    assert (model.class_name, record.unit, record.unit_from) == ("table", pytest.approx(0.01), "meshes")
    np.testing.assert_allclose(size_of(model), [1.6, 1.01, 0.75], atol=1e-6)
    (joint,) = model.joints
    assert (joint.lower, joint.upper) == (0.0, 1.5)
    np.testing.assert_allclose(joint.axis, [-1, 0, 0], atol=1e-9)
    # The scene of the DAE shifts the table by 5, 6 and 7 cm.
    np.testing.assert_allclose(joint.origin, [-0.05, -0.505, 0.68], atol=1e-6)


@pytest.mark.parametrize(("up", "order"), [("Y_UP", (0, 2, 1)), ("Z_UP", (0, 1, 2)), ("X_UP", (1, 2, 0))])
def test_dae_up_axis_and_unit(tmp_path, up, order) -> None:
    size = np.empty(3)
    size[:] = np.array([45.0, 50.0, 90.0])[np.argsort(order)]
    write(tmp_path / "in" / "chair_7.dae", dae(0.01, up, tuple(size.tolist())))
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert (record.unit, record.unit_from, record.up_from) == (0.01, "file", "file")
    assert record.up == {"X_UP": "+x", "Y_UP": "+y", "Z_UP": "+z"}[up]
    assert size_of(model)[2] == pytest.approx(0.9)
    assert sorted(np.round(size_of(model)[:2], 6).tolist()) == [0.45, 0.5]


def test_dae_agrees_with_pycollada() -> None:
    pytest.importorskip("collada")
    # Unlike us, pycollada wants different ids for a scene and its node.
    text = dae(0.5, "Z_UP", (1.0, 2.0, 3.0)).replace('node id="same"', 'node id="other"').encode()
    (patch,) = parse_collada(text, "a.dae").patches
    other = trimesh.load(trimesh.util.wrap_as_stream(text), file_type="dae", force="mesh")
    mine = trimesh.Trimesh(patch.vertices, patch.faces)
    np.testing.assert_allclose(mine.bounds, other.bounds)
    assert mine.volume == pytest.approx(6.0) and patch.color == (0.0, 1.0, 0.0)


def test_a_dae_index_of_more_than_64_bits_is_bad_input() -> None:
    text = dae(0.5, "Z_UP", (1.0, 2.0, 3.0))
    start = text.index("<p>") + 3
    with pytest.raises(BadInput, match="indices are not numbers"):
        parse_collada((text[:start] + "9" * 30 + " " + text[start:]).encode(), "a.dae")


def test_glb_gltf_stl_and_obj(tmp_path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    lying = trimesh.creation.box((0.5, 0.9, 0.45))  # y up, metres: the glTF specification
    (folder / "chair_a.glb").write_bytes(lying.export(file_type="glb"))
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene([lying])).items():
        (folder / name.replace("model.gltf", "chair_b.gltf")).write_bytes(data)
    trimesh.creation.box((500, 450, 900)).export(folder / "chair_c.stl")  # nothing declared: millimetres, z up
    trimesh.creation.box((50, 90, 45)).export(folder / "chair_d.obj")  # nothing declared: centimetres, y up
    library = add(folder, tmp_path / "out")
    records = ImportFile.read(library.path("imports.json")).models
    assert [record.format for record in records] == ["GLB", "GLTF", "STL", "OBJ"]
    assert [(r.unit, r.unit_from, r.up) for r in records] == [
        (1.0, "format", "+y"),
        (1.0, "format", "+y"),
        (0.001, "guessed", "+z"),
        (0.01, "guessed", "+y"),
    ]
    for model in library.info.models:
        np.testing.assert_allclose(sorted(size_of(model).tolist()), [0.45, 0.5, 0.9], atol=1e-6)
        assert size_of(model)[2] == pytest.approx(0.9, abs=1e-6)


def test_a_declared_unit_is_kept_and_questioned(tmp_path) -> None:
    write(tmp_path / "in" / "bed.dae", dae(1.0, "Z_UP", (200.0, 160.0, 60.0)))
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert size_of(model)[0] == pytest.approx(200.0)
    assert any("in cm it would be usual (--unit cm)" in finding for finding in record.findings)
    model, record = only(add(tmp_path / "in", tmp_path / "again", unit="cm"))
    assert size_of(model)[0] == pytest.approx(2.0)
    assert record.unit_from == "option" and not any("unusual for its class" in f for f in record.findings)


def test_shapenetsem_columns(tmp_path) -> None:
    folder = tmp_path / "in"
    obj_box(folder / "models" / "abc1.obj", (40.0, 20.0, 35.0))
    obj_box(folder / "models" / "unlisted.obj", (1, 1, 1))
    rows = "fullId,category,wnsynset,up,front,unit,isContainerLike,name\n"
    rows += 'wss.abc1,"Chair,_Attributes",1,"0.0\\,1.0\\,0.0","1.0\\,0.0\\,0.0",0.0254,,a\nwss.gone,Table,2,,,0.01,,b\n'
    write(folder / "metadata.csv", rows)
    library = add(folder, tmp_path / "out", mapping='[models]\n"unlisted" = "skip"\n')
    (model,) = library.info.models
    record = ImportFile.read(library.path("imports.json")).models[0]
    assert (record.format, record.class_name, record.unit) == ("ShapeNetSem", "chair", 0.0254)
    assert (record.up, record.front, record.front_from) == ("+y", "+x", "file")
    np.testing.assert_allclose(size_of(model), 0.0254 * np.array([35.0, 40.0, 20.0]), atol=1e-6)


def test_partnet_mobility_layout(tmp_path) -> None:
    folder = tmp_path / "in" / "45132"
    obj_box(folder / "textured_objs" / "original-1.obj", (0.8, 0.9, 0.5))  # y up in the meshes
    obj_box(folder / "textured_objs" / "original-2.obj", (0.7, 0.3, 0.4))
    write(folder / "meta.json", json.dumps({"model_cat": "StorageFurniture", "anno_id": "1"}))
    write(folder / "semantics.txt", "link_0 slider drawer\nlink_1 static cabinet_frame\n")
    mobility = """<?xml version="1.0" ?><robot name="partnet_1"><link name="base"/>
    <link name="link_0"><visual name="handle-1"><origin xyz="0 0 0.06"/><geometry>
    <mesh filename="textured_objs/original-2.obj"/></geometry></visual></link>
    <link name="link_1"><visual name="frame-2"><geometry><mesh filename="textured_objs/original-1.obj"/></geometry>
    </visual></link>
    <joint name="joint_1" type="fixed"><origin rpy="1.570796326794897 0 -1.570796326794897" xyz="0 0 0"/>
    <child link="link_1"/><parent link="base"/></joint>
    <joint name="joint_0" type="prismatic"><origin xyz="0 0 0"/><axis xyz="0 0 1"/><child link="link_0"/>
    <parent link="link_1"/><limit lower="0" upper="0.4"/></joint></robot>"""
    write(folder / "mobility.urdf", mobility)
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert (record.format, model.class_name, record.front) == ("PartNet-Mobility", "cabinet", "-x")
    np.testing.assert_allclose(size_of(model), [0.8, 0.51, 0.9], atol=1e-6)
    (joint,) = model.joints
    np.testing.assert_allclose(joint.axis, [0, -1, 0], atol=1e-9)  # the drawer comes out to the front
    assert joint.upper == pytest.approx(0.4) and joint.handle is not None


def test_a_part_on_a_moving_part_is_held_fast(tmp_path) -> None:
    urdf_cabinet(tmp_path / "in")
    path = tmp_path / "in" / "old_cabinet.urdf"
    path.write_text(path.read_text().replace('name="grip" type="fixed"', 'name="grip" type="continuous"'))
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert len(model.joints) == 2
    assert any("'grip' moves on a part that moves" in finding for finding in record.findings)


def digest(root: Path) -> str:
    files = sorted(path for path in root.rglob("*") if path.is_file())
    return hashlib.sha256(b"".join(str(f.relative_to(root)).encode() + f.read_bytes() for f in files)).hexdigest()


def test_same_bytes_again_and_merging(tmp_path) -> None:
    urdf_cabinet(tmp_path / "in")
    first = add(tmp_path / "in", tmp_path / "a")
    add(tmp_path / "in", tmp_path / "b")
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    both = add(tmp_path / "in", tmp_path / "c", library=first)
    assert [model.id for model in both.info.models] == ["old_cabinet", "old_cabinet_2"]
    assert len(ImportFile.read(both.path("imports.json")).models) == 2
    before, after = (posed_mesh(model_folder(both, model.id), model, {}) for model in both.info.models)
    np.testing.assert_array_equal(before.vertices, after.vertices)


def test_unknown_class_is_left_out_or_an_object(tmp_path) -> None:
    obj_box(tmp_path / "in" / "gizmo.obj", (0.2, 0.2, 0.2))
    obj_box(tmp_path / "in" / "mug.obj", (0.08, 0.1, 0.08))
    library = add(tmp_path / "in", tmp_path / "a")
    assert [model.class_name for model in library.info.models] == ["cup"]
    left_out = ImportFile.read(library.path("imports.json")).models[0]
    assert left_out.id == "" and "nothing tells its class" in left_out.findings[0]
    kinds = {m.id: m.class_name for m in add(tmp_path / "in", tmp_path / "b", unknown="object").info.models}
    assert kinds == {"gizmo": "object", "mug": "cup"}
    mapping = '[models]\n"gi*" = { class_name = "box", unit = "dm", up = "+z" }\n'
    mapped = add(tmp_path / "in", tmp_path / "c", mapping=mapping).info.models
    assert mapped[0].class_name == "box" and size_of(mapped[0])[0] == pytest.approx(0.02)
    with pytest.raises(BadInput, match="'spoon_rest' is not in the vocabulary"):
        add(tmp_path / "in", tmp_path / "d", mapping='[models]\n"a" = "spoon_rest"\n')


def test_links_out_of_the_folder_are_not_followed(tmp_path) -> None:
    secret = obj_box(tmp_path / "secret" / "chair.obj", (1, 1, 1))
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "chair.obj").symlink_to(secret)
    folder = SourceFolder(tmp_path / "in")
    assert folder.files() == [] and folder.find("chair.obj", folder.root) is None


@given(st.text(max_size=60))
@settings(max_examples=150, deadline=None)
def test_no_name_leads_out_of_the_folder(tmp_path_factory, name) -> None:
    root = tmp_path_factory.getbasetemp() / "inside"
    root.mkdir(exist_ok=True)
    found = SourceFolder(root).find(f"../../{name}", root)
    assert found is None or found.is_relative_to(root.resolve())


@given(
    st.floats(-6, 6, allow_nan=False),
    st.floats(0.001, 6, allow_nan=False),
    st.lists(st.floats(0, 1), min_size=1, max_size=3),
)
def test_limits_keep_their_poses(lower, width, shares) -> None:
    axis = np.array([0.0, 0.6, 0.8])
    closed, turned, low, high = normal_limits(axis, lower, lower + width)
    assert low <= 0.0 <= high and -low <= high
    for share in shares:  # every value of the file is one of ours
        value = lower + share * width
        ours = float((value - closed) * (turned @ axis))
        assert low - 1e-9 <= ours <= high + 1e-9
        np.testing.assert_allclose(ours * turned + closed * axis, value * axis, atol=1e-9)


@pytest.mark.parametrize("up", list(AXES))
@pytest.mark.parametrize("front", list(AXES))
def test_model_rotation_takes_up_to_z_and_front_to_minus_y(up, front) -> None:
    rotation = model_rotation(AXES[up], AXES[front])
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ AXES[up], [0, 0, 1], atol=1e-12)
    if up[1] != front[1]:
        np.testing.assert_allclose(rotation @ AXES[front], [0, -1, 0], atol=1e-12)


def test_class_by_name() -> None:
    said = {
        "TVCabinet_01": "cabinet",
        "TV_02": "monitor",
        "hingecabinet": "cabinet",
        "ovenroot": "oven",
        "NightStand": "cabinet",
        "office chairs": "chair",
        "Tableware": None,
        "door": None,  # a layout class is no furniture
    }
    assert {name: class_of((name,)) for name in said} == said


def test_connected_components_become_convex_pieces() -> None:
    boxes = [trimesh.creation.box((0.1, 0.1, 0.7)).apply_translation((x, y, 0.35)) for x in (0, 1) for y in (0, 0.6)]
    table = trimesh.util.concatenate(
        [*boxes, trimesh.creation.box((1.2, 0.8, 0.04)).apply_translation((0.5, 0.3, 0.72))]
    )
    surface = Surface(np.asarray(table.vertices), np.asarray(table.faces), painted_faces(len(table.faces), None))
    pieces, findings = convex_pieces([surface], decompose=False)
    assert len(pieces) == 5 and findings == []
    hollow = trimesh.creation.annulus(0.4, 0.5, 0.6)
    ring = Surface(np.asarray(hollow.vertices), np.asarray(hollow.faces), painted_faces(len(hollow.faces), None))
    pieces, findings = convex_pieces([ring], decompose=False)
    assert len(pieces) == 1 and "1 hollow pieces are filled" in findings[0]


def test_coacd_cuts_up_hollow_pieces_and_is_kept(tmp_path, monkeypatch) -> None:
    if coacd_version() == "absent":
        with pytest.raises(MissingDependency, match="coacd"):
            uses_coacd(AdditionParameters(decomposition="coacd"))
        pytest.skip("coacd is not installed")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    hollow = trimesh.creation.annulus(0.4, 0.5, 0.6)
    ring = Surface(np.asarray(hollow.vertices), np.asarray(hollow.faces), painted_faces(len(hollow.faces), None))
    pieces, _ = convex_pieces([ring], decompose=True)
    assert len(pieces) > 3
    (kept,) = (tmp_path / "scenewright" / "decompositions").iterdir()
    written = kept.stat().st_mtime_ns
    again, _ = convex_pieces([ring], decompose=True)
    assert kept.stat().st_mtime_ns == written and len(again) == len(pieces)


def test_real_mjcf_furniture_keeps_its_joints(tmp_path) -> None:
    data = real_data("furniture_mjcf")
    mapping = '[models]\n"kitchen*" = "skip"\n"kettle*" = "skip"\n"light*" = "skip"\n"misc/*" = "skip"\n'
    mapping += '"dishwasher" = "skip"\n"*hood*" = "skip"\n"bin*" = "skip"\n"oven*" = "skip"\n'
    library = add(data, tmp_path / "out", mapping=mapping)
    joints = {model.id: [(j.name, j.type, j.upper) for j in model.joints] for model in library.info.models}
    assert joints["microwave"] == [("micro0joint", "revolute", pytest.approx(2.094))]
    assert joints["slidecabinet"] == [("slidedoor_joint", "prismatic", pytest.approx(0.44))]
    assert [entry[2] for entry in joints["hingecabinet"]] == [pytest.approx(1.57)] * 2
    assert [entry[1:] for entry in joints["studyTable"]] == [("prismatic", 0.48), ("prismatic", 0.6)]
    by_id = {model.id: model for model in library.info.models}
    left, right = by_id["hingecabinet"].joints
    np.testing.assert_allclose([left.axis, right.axis], [[0, 0, -1], [0, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(np.subtract(right.origin, left.origin), [0.76, 0, 0], atol=1e-6)


@pytest.mark.parametrize(("name", "models", "coupled"), [("furniture_mjcf", 41, 11), ("aws_furniture", 18, 0)])
def test_real_furniture_holds_nothing_unknown(name, models, coupled) -> None:
    found = list(find_models(SourceFolder(real_data(name))))
    assert len(found) == models and not any(isinstance(model, Unread) for model in found)
    told = ("named elsewhere", "texture of material")
    findings = [finding for model in found for finding in model.findings if not any(word in finding for word in told)]
    assert len(findings) == coupled and all("of <equality> (joint) left out" in finding for finding in findings)


def test_real_dae_furniture_is_in_centimetres(tmp_path) -> None:
    folder = real_data("aws_furniture") / "aws_robomaker_residential_ChairA_01"
    model, record = only(add(folder, tmp_path / "out", class_name="chair"))
    np.testing.assert_allclose(sorted(size_of(model).tolist()), [0.437, 0.474, 0.913], atol=1e-3)
    assert (record.unit, record.unit_from, record.front_from) == (0.01, "meshes", "back rest")
    assert any(plane.horizontal and 0.35 < plane.center[2] < 0.5 for plane in model.states[0].planes)  # the seat


def test_the_command_takes_a_folder_and_prints_a_table(tmp_path, capsys) -> None:
    obj_box(tmp_path / "in" / "mug.obj", (0.08, 0.1, 0.08))
    out = tmp_path / "out"
    assert command_line(["library", "add", str(tmp_path / "in"), "--out", str(out), "--decomposition", "hulls"]) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}\n"
    (row,) = [line for line in said.err.splitlines() if line.startswith("mug ")]
    assert row.split()[:7] == ["mug", "cup", "0.08", "x", "0.08", "x", "0.10"]
    assert "m (assumed)" in row and "+y (assumed)" in row
    (head,) = [line for line in said.err.splitlines() if line.startswith("model ")]
    assert head.index("size [m]") == row.index("0.08"), "columns stand under each other"
    assert row[head.index("good for") :].startswith("carried"), "what a cup is good for"
    twice = ["library", "add", str(tmp_path), "--models", str(tmp_path), "--out", str(out)]
    assert command_line(twice) == 2 and command_line(["library", "add", "--out", str(out)]) == 2
    assert command_line(["library", "add", str(tmp_path / "nowhere"), "--out", str(out)]) == 3
    assert all(line.startswith("error: ") for line in capsys.readouterr().err.splitlines())
