"""URDFs that are broken in one way each, and what the check says of them."""

from __future__ import annotations

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
"""Fault -> (URDF, one of the problems that are found)."""
