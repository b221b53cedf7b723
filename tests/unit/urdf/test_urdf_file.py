"""URDF records: what is written is read back, here and by yourdfpy; what is wrong is found."""

from __future__ import annotations

import numpy as np
import pytest
import yourdfpy
from scenewright.stages.kit.formats.urdf_check import check_urdf
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
