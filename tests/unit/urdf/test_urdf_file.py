"""URDF records: what is written is read back, here and by yourdfpy; what is wrong is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.urdf_check import check_urdf, require_sound
from scenewright.stages.kit.formats.urdf_file import Link, Shape, Urdf, UrdfJoint, number, parse_urdf, write_urdf
from scenewright.stages.kit.geometry.solids import MassProperties
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation

SOUND_INERTIA = MassProperties(2.0, np.array([0.1, -0.2, 0.3]), np.diag([0.02, 0.03, 0.04]))


def sample() -> Urdf:
    """A box on a turned fixed joint, a lid on a hinge, a thing on a floating joint."""
    turned = transform_from(Rotation.from_euler("xyz", [0.3, -0.4, 1.2]).as_matrix(), np.array([1.0, 2.0, 3.0]))
    cube = Shape(box_size=(0.2, 0.3, 0.4), link_from_shape=turned, color=(0.5, 0.25, 0.125, 1.0))
    return Urdf(
        "sample",
        (
            Link("world"),
            Link("body", SOUND_INERTIA, (cube,), (Shape(box_size=(0.2, 0.3, 0.4)),)),
            Link("lid", SOUND_INERTIA),
            Link("thing", SOUND_INERTIA),
        ),
        (
            UrdfJoint("mount", "fixed", "world", "body", turned),
            UrdfJoint("hinge", "revolute", "body", "lid", turned, axis=(0, 0, -1), lower=0, upper=2, damping=0.3),
            UrdfJoint("free", "floating", "body", "thing", np.eye(4)),
        ),
    )


def test_round_trip(tmp_path):
    write_urdf(tmp_path / "a.urdf", sample())
    read = parse_urdf(tmp_path / "a.urdf")
    assert [link.name for link in read.links] == ["world", "body", "lid", "thing"]
    assert read.roots() == ["world"]
    for ours, theirs in zip(sample().joints, read.joints, strict=True):
        assert (ours.name, ours.type, ours.parent, ours.child) == (
            theirs.name,
            theirs.type,
            theirs.parent,
            theirs.child,
        )
        assert theirs.parent_from_child == pytest.approx(ours.parent_from_child, abs=1e-7)
    hinge = read.joints[1]
    assert (hinge.axis, hinge.lower, hinge.upper, hinge.damping) == ((0, 0, -1), 0, 2, 0.3)
    inertial = read.link("body").inertial
    assert inertial is not None
    assert inertial.inertia == pytest.approx(SOUND_INERTIA.inertia)
    shape = read.link("body").visuals[0]
    assert shape.color == (0.5, 0.25, 0.125, 1.0)
    assert shape.link_from_shape == pytest.approx(sample().links[1].visuals[0].link_from_shape, abs=1e-7)
    write_urdf(tmp_path / "b.urdf", sample())
    assert (tmp_path / "a.urdf").read_bytes() == (tmp_path / "b.urdf").read_bytes()
    assert check_urdf(tmp_path / "a.urdf") == []


def test_yourdfpy_reads_the_same_transforms(tmp_path):
    write_urdf(tmp_path / "a.urdf", sample())
    robot = yourdfpy.URDF.load(str(tmp_path / "a.urdf"))
    hinge = sample().joints[1].parent_from_child
    for value in (0.0, 0.7):
        robot.update_cfg({"hinge": value})
        turn = transform_from(Rotation.from_rotvec([0, 0, -value]).as_matrix(), np.zeros(3))
        assert robot.get_transform("lid", "world") == pytest.approx(hinge @ hinge @ turn, abs=1e-7)


def test_numbers_are_clean():
    assert (number(-0.0), number(1e-15), number(0.1), number(-2.5)) == ("0", "0", "0.1", "-2.5")


INERTIA = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
HINGE = '<limit lower="0" upper="1" effort="1" velocity="1"/>'


def robot(links: str = "", joints: str = "") -> str:
    return f'<robot name="r"><link name="a"/><link name="b">{INERTIA}</link>{links}{joints}</robot>'


def joint(inner: str = HINGE, kind: str = "revolute", name: str = "j", parent: str = "a", child: str = "b") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inner}</joint>'


def mesh(name: str, scale: str = "1 1 1") -> str:
    return f'<visual><geometry><mesh filename="{name}" scale="{scale}"/></geometry></visual>'


def inertial(mass: str, xx: str, yy: str, zz: str, xy: str = "0") -> str:
    tensor = f'ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="0" iyz="0"'
    return f'<inertial><mass value="{mass}"/><inertia {tensor}/></inertial>'


CARRIED = joint() + joint("", "fixed", "k", "b", "c")
"""Link c is fixed to b, b hangs on a by a hinge."""


def link(inner: str, name: str = "c", joints: str = CARRIED) -> str:
    return robot(f'<link name="{name}">{inner}</link>', joints)


BROKEN = {
    "missing mesh": (link(mesh("gone.obj")), "mesh_missing"),
    "mesh outside": (link(mesh("../outside.obj")), "mesh_outside"),
    "absolute mesh": (link(mesh("/etc/passwd")), "mesh_outside"),
    "mesh by url": (link(mesh("package://x/y.obj")), "mesh_outside"),
    "mesh scale zero": (link(mesh("m.obj", "0 0 0")), "geometry"),
    "cycle": (robot(f'<link name="c">{INERTIA}</link>', CARRIED + joint("", "fixed", "l", "c", "b")), "cycle"),
    "whole cycle": (robot("", joint() + joint("", "fixed", "k", "b", "a")), "cycle"),
    "dangling child": (robot("", joint(child="nobody")), "dangling"),
    "dangling parent": (robot("", joint(parent="nobody")), "dangling"),
    "two roots": (robot(f'<link name="c">{INERTIA}</link>', joint()), "roots"),
    "NaN origin": (robot("", joint('<origin xyz="nan 0 0"/>' + HINGE)), "not_finite"),
    "NaN angle": (robot("", joint('<origin rpy="0 inf 0"/>' + HINGE)), "not_finite"),
    "NaN inertia": (link(inertial("1", "nan", "1", "1")), "not_finite"),
    "zero axis": (robot("", joint('<axis xyz="0 0 0"/>' + HINGE)), "axis"),
    "lower over upper": (robot("", joint('<limit lower="1" upper="0" effort="1" velocity="1"/>')), "limits"),
    "zero effort": (robot("", joint('<limit lower="0" upper="1" effort="0" velocity="1"/>')), "limits"),
    "negative mass": (link(inertial("-1", "1", "1", "1")), "mass"),
    "zero mass": (link(inertial("0", "1", "1", "1")), "mass"),
    "indefinite inertia": (link(inertial("1", "1", "1", "1", "2")), "inertia"),
    "triangle inequality": (link(inertial("1", "1", "1", "3")), "inertia"),
    "moving link without inertia": (link("", joints=joint() + joint(HINGE, "revolute", "k", "b", "c")), "no_inertia"),
    "two links of one name": (robot(f'<link name="b">{INERTIA}</link>', joint()), "duplicate"),
    "two joints of one name": (link(INERTIA, joints=joint() + joint("", "fixed", "j", "b", "c")), "duplicate"),
    "name with blank": (link(INERTIA, "c c", joint() + joint("", "fixed", "k", "b", "c c")), "name"),
    "name not ASCII": (link(INERTIA, "t\u00fcr", joint() + joint("", "fixed", "k", "b", "t\u00fcr")), "name"),
    "unknown joint type": (robot("", joint(kind="elastic")), "joint_type"),
    "no robot": ("<scene/>", "unreadable"),
    "torn": ('<robot name="r"><link name=', "unreadable"),
    "empty file": ("", "unreadable"),
    "entities": ('<!DOCTYPE r [<!ENTITY a "aaaa">]><robot name="&a;"><link name="a"/></robot>', "unreadable"),
    "words for numbers": (robot("", joint('<origin xyz="one 0 0"/>' + HINGE)), "unreadable"),
    "two numbers for three": (robot("", joint('<origin xyz="0 0"/>' + HINGE)), "unreadable"),
    "joint without child": (robot("", '<joint name="j" type="fixed"><parent link="a"/></joint>'), "unreadable"),
    "no links": ('<robot name="r"/>', "roots"),
}


def test_the_yardstick_itself_is_sound(tmp_path):
    (tmp_path / "good.urdf").write_text(robot("", joint()), encoding="utf-8")
    assert check_urdf(tmp_path / "good.urdf") == []


@pytest.mark.parametrize("case", sorted(BROKEN))
def test_every_kind_of_damage_is_found(case, tmp_path):
    text, kind = BROKEN[case]
    (tmp_path / "m.obj").write_text("v 0 0 0\n")
    path = tmp_path / "inside" / "bad.urdf"
    path.parent.mkdir()
    (tmp_path / "outside.obj").write_text("v 0 0 0\n")
    path.write_text(text, encoding="utf-8")
    problems = check_urdf(path)
    assert kind in {problem.kind for problem in problems}, problems
    with pytest.raises(BadInput, match=r"bad\.urdf"):
        require_sound(path)


def test_a_link_out_of_the_folder_by_symbolic_link_is_found(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.obj").write_text("v 0 0 0\n")
    (folder / "m.obj").symlink_to(tmp_path / "secret.obj")
    text = f'<robot name="r"><link name="a">{INERTIA}{mesh("m.obj")}</link></robot>'
    (folder / "r.urdf").write_text(text)
    assert [problem.kind for problem in check_urdf(folder / "r.urdf")] == ["mesh_outside"]


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match="none.urdf"):
        parse_urdf(Path(tmp_path / "none.urdf"))
