"""URDF: capsules, joints that no model here has, units of meshes, and what is told instead of read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.library.importing.discovery import Unread, find_models
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel

from tests.unit.library.test_addition import add, obj_box, only, size_of, write


def shape(geometry: str, at: str = "0 0 0") -> str:
    return f'<visual><origin xyz="{at}"/><geometry>{geometry}</geometry></visual>'


BODY = f'<link name="body">{shape("""<box size="0.4 0.3 0.6"/>""", "0 0 0.3")}</link>'
LEAF = shape('<box size="0.4 0.02 0.6"/>', "0.2 -0.01 0")
DOOR = f'<link name="door">{LEAF}</link>'
HINGE = """<joint name="hinge" type="revolute"><origin xyz="-0.2 -0.15 0.3"/><parent link="body"/><child link="door"/>
<axis xyz="0 0 1"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>"""


def robot(inside: str) -> str:
    return f'<robot name="cabinet">{inside}</robot>'


def read(folder: Path, text: str) -> SourceModel:
    write(folder / "cabinet.urdf", text)
    (model,) = find_models(SourceFolder(folder))
    assert isinstance(model, SourceModel), model
    return model


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        ((LEAF, f"{LEAF}{shape('<cone/>')}"), "a shape of link 'door' is left out: <cone>"),
        ((LEAF, f"{LEAF}{shape('')}"), "a shape of link 'door' is left out: it is empty"),
        ((LEAF, f"{LEAF}<wheel/>"), "<wheel> in <link> is not read"),
        ((LEAF, LEAF.replace("<geometry>", "<bump/><geometry>")), "<bump> in <visual> is not read"),
        (("</axis>", "</axis>"), ""),
        (("<axis", "<spring/><axis"), "<spring> in <joint> is not read"),
        (
            (BODY, BODY + '<x:macro xmlns:x="http://xacro"><link name="a"/><link name="b"/></x:macro>'),
            "<macro> in <robot> is not read: 2 <link> in it left out",
        ),
        (
            ("<axis", '<mimic joint="other"/><axis'),
            "joint 'hinge' follows joint 'other' (mimic): here both move freely",
        ),
        (
            ("</visual>", '<material name="oak"><texture filename="oak.png"/></material></visual>'),
            "texture of material 'oak' is not read: what it covers has one colour",
        ),
        (("revolute", "planar"), "joint 'hinge' is of type 'planar': held fast"),
    ],
)
def test_what_is_left_out_is_told(tmp_path: Path, change: tuple[str, str], finding: str) -> None:
    model = read(tmp_path, robot(BODY + DOOR + HINGE).replace(*change))
    assert model.findings == ((finding,) if finding else ())


def test_a_joint_that_floats_is_told_unless_all_of_the_model_hangs_on_it(tmp_path: Path) -> None:
    write(tmp_path / "in" / "cabinet.urdf", robot(BODY + DOOR + HINGE.replace("revolute", "floating")))
    _, record = only(add(tmp_path / "in", tmp_path / "a"))
    assert "joint 'hinge' floats: held fast" in record.findings
    world = '<link name="world"/><joint name="free" type="floating"><parent link="world"/><child link="body"/></joint>'
    write(tmp_path / "in" / "cabinet.urdf", robot(BODY + DOOR + HINGE + world))
    model, record = only(add(tmp_path / "in", tmp_path / "b"))
    assert len(model.joints) == 1 and not any("floats" in finding for finding in record.findings)


def test_a_capsule_is_a_shape(tmp_path: Path) -> None:
    """As MuJoCo reads URDF: `length` is that of the cylinder, the half balls come on top."""
    capsule = shape('<capsule radius="0.05" length="0.5"/>', "0.2 -0.05 0")
    write(tmp_path / "in" / "cabinet.urdf", robot(BODY + DOOR.replace(LEAF, capsule) + HINGE))
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    np.testing.assert_allclose(size_of(model), [0.4, 0.4, 0.6], atol=1e-3)
    assert record.joints == 1 and not any("left out" in finding for finding in record.findings)
    mujoco = pytest.importorskip("mujoco")
    alone = f'<robot name="a"><link name="a">{capsule.replace("visual", "collision")}</link></robot>'
    np.testing.assert_allclose(mujoco.MjModel.from_xml_string(alone).geom_size[0][:2], [0.05, 0.25])


def cabinet_of_meshes(folder: Path, millimetres: str = "") -> None:
    """A carcass as a mesh in mm, a door and its hinge in metres (or all in mm)."""
    obj_box(folder / "meshes" / "carcass.obj", (400.0, 300.0, 600.0))
    body = f'<link name="body">{shape("""<mesh filename="meshes/carcass.obj"/>""")}</link>'
    text = robot(body + DOOR + HINGE).replace("-0.2 -0.15 0.3", "-0.2 -0.15 0")
    if millimetres:
        text = text.replace("-0.2 -0.15 0", "-200 -150 0").replace("0.4 0.02 0.6", "400 20 600")
        text = text.replace("0.2 -0.01 0", "200 -10 0")
    write(folder / "cabinet.urdf", text)


@pytest.mark.parametrize("millimetres", ["", "all"])
def test_the_unit_that_is_advised_is_right_when_it_is_said(tmp_path: Path, millimetres: str) -> None:
    cabinet_of_meshes(tmp_path / "in", millimetres)
    _, record = only(add(tmp_path / "in", tmp_path / "a"))
    assert any("in mm it would be usual (--unit mm)" in finding for finding in record.findings)
    model, record = only(add(tmp_path / "in", tmp_path / "b", unit="mm"))
    np.testing.assert_allclose(size_of(model), [0.4, 0.32, 0.6], atol=1e-6)
    np.testing.assert_allclose(model.joints[0].origin, [-0.2, -0.14, 0.3], atol=1e-6)
    assert (record.unit, record.unit_from) == (0.001, "option")
    assert any("joints and poses are in mm as well" in finding for finding in record.findings) == bool(millimetres)
    assert not any("unusual for its class" in finding or " lies " in finding for finding in record.findings)


def test_a_hinge_far_from_its_part_and_a_part_far_from_all_others_are_told(tmp_path: Path) -> None:
    far = robot(BODY + DOOR.replace("0.2 -0.01 0", "0.2 3 0") + HINGE)
    write(tmp_path / "in" / "cabinet.urdf", far)
    _, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert any(
        finding.startswith("the axis of joint 'hinge' passes 2.99 m from its part") for finding in record.findings
    )
    assert any(finding.startswith("'door' lies 2.69 m from everything else") for finding in record.findings)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("cabinet.urdf.xacro", "xacro cabinet.urdf.xacro > cabinet.urdf"),
        ("cabinet.xacro", "xacro cabinet.xacro > cabinet.urdf"),
        ("cabinet.usda", "USD is not read: open it in Blender and export GLB"),
        ("cabinet.usdz", "USD is not read"),
        ("cabinet.fbx", "FBX is not read"),
        ("cabinet.zip", "an archive: unpack it"),
        ("cabinet.mjb", "mj_saveLastXML"),
        ("cabinet.step", "CAD solids are not read: open it in FreeCAD and export OBJ or GLB"),
    ],
)
def test_files_of_other_formats_are_named_with_a_way(tmp_path: Path, name: str, reason: str) -> None:
    write(tmp_path / "package.xml", "<package/>")
    for number in range(3):
        write(tmp_path / str(number) / name, "anything")
    (found,) = find_models(SourceFolder(tmp_path))
    assert isinstance(found, Unread) and found.source == f"0/{name}"
    assert reason in found.reason and found.reason.endswith(", and 2 more like it")


def test_sources_beside_what_was_made_of_them_are_not_spoken_of(tmp_path: Path) -> None:
    read(tmp_path, robot(BODY))
    for name in ("cabinet.urdf.xacro", "cabinet.blend", "cabinet.fbx"):
        write(tmp_path / name, "anything")
    assert all(isinstance(found, SourceModel) for found in find_models(SourceFolder(tmp_path)))


def test_descriptions_in_files_called_xml(tmp_path: Path) -> None:
    write(tmp_path / "a.xml", robot(BODY))
    write(tmp_path / "b.xml", f'<sdf version="1.7"><model name="b"><link name="a">{LEAF}</link></model></sdf>'.replace(
        '<box size="0.4 0.02 0.6"/>', "<box><size>1 1 1</size></box>"))  # fmt: skip
    write(tmp_path / "package.xml", "<package/>")
    found = list(find_models(SourceFolder(tmp_path)))
    assert [model.format for model in found if isinstance(model, SourceModel)] == ["URDF", "SDF"] and len(found) == 2


def test_parts_that_nothing_includes(tmp_path: Path) -> None:
    write(tmp_path / "leaf.xml", '<mujocoinclude><body><geom type="box" size="1 1 1"/></body></mujocoinclude>')
    write(tmp_path / "assets.xml", "<mujocoinclude><asset/></mujocoinclude>")
    (found,) = find_models(SourceFolder(tmp_path))
    assert isinstance(found, Unread) and found.source == "leaf.xml" and "no file here includes" in found.reason
