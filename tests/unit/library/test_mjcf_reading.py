"""MJCF elements that place others, against MuJoCo where it is installed; and those that are told instead of read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.library.importing import limits, mjcf_document
from scenewright.stages.library.importing.discovery import Unread, find_models
from scenewright.stages.library.importing.grouping import Group, grouped
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel

from tests.unit.library.test_addition import add, only, size_of, write

BOX = '<geom type="box" size="0.2 0.15 0.3"/>'
DOOR = """<body name="door" pos="-0.2 -0.16 0"><joint name="hinge" axis="0 0 1" range="0 100" pos="0.01 0 0"/>
<geom type="box" size="0.2 0.01 0.3" pos="0.2 0 0"/></body>"""
PART = f"""<mujoco model="part"><compiler angle="radian"/><default><default class="oak"><geom rgba="0.5 0.4 0.3 1"/>
</default></default><worldbody><body name="leaf" pos="0.1 0 0" euler="0 0 0.5" childclass="oak">{BOX}
<body name="flap" pos="0 0 0.31"><joint name="fold" axis="1 0 0" range="-1.2 0"/><geom type="box" size="0.2 0.1 0.01"/>
</body></body></worldbody></mujoco>"""


def read(folder: Path) -> list[SourceModel | Unread]:
    return list(find_models(SourceFolder(folder)))


def models(folder: Path) -> list[SourceModel]:
    found = read(folder)
    assert all(isinstance(model, SourceModel) for model in found), found
    return [model for model in found if isinstance(model, SourceModel)]


def centres(groups: list[Group]) -> np.ndarray:
    """Return the middles (N, 3) of all shapes in the root frame, joints at 0, sorted."""
    rows = [
        apply(pose, surface.vertices).mean(axis=0)
        for group in groups
        for link, pose in group.links
        for surface in link.visual
    ]
    return np.array(sorted(np.round(rows, 6).tolist()))


CLASSES = """<default><geom type="box" size="0.1 0.1 0.1"/><default class="out"><geom pos="0 0 0.5"/>
<default class="side"><geom pos="0.3 0 0" euler="0 0 20"/><joint axis="0 1 0" pos="0 0 0.2" range="0 60"/></default>
</default></default>"""
PLACING = {
    "a frame around a door": f'<body name="cabinet" pos="0 0 0.3">{BOX}<frame euler="0 0 180">{DOOR}</frame></body>',
    "frames in frames": f"""<frame pos="0 0 0.3"><frame euler="0 0 30"><body name="cabinet">{BOX}
        <frame pos="0.02 0 0" quat="0.9 0 0 0.3"><frame axisangle="1 0 0 20">{DOOR}</frame></frame></body>
        </frame></frame>""",
    "a joint in a frame": f"""<body name="cabinet">{BOX}<body name="door" pos="-0.2 -0.16 0"><frame pos="0.02 0 0"
        euler="0 90 10"><joint name="hinge" axis="1 0 0" pos="0 0.01 0.02" range="0 90"/><site name="grip" pos="0 0 1"/>
        </frame><geom type="box" size="0.2 0.01 0.3" pos="0.2 0 0"/></body></body>""",
    "replicas": f"""<body name="cabinet">{BOX}<replicate count="3" offset="0 0.03 0.2" euler="0 0 40"><body name="tray"
        pos="0.1 0 0"><joint name="slide" type="slide" axis="1 0 0" range="0 0.3"/>
        <geom type="box" size="0.1 0.1 0.01" pos="0 0.05 0"/></body></replicate></body>""",
    "replicas of replicas": f"""<body name="cabinet">{BOX}<replicate count="2" offset="1 0 0"><frame euler="0 0 30">
        <replicate count="3" offset="0 0.5 0"><geom type="box" size="0.1 0.2 0.1"/></replicate></frame></replicate>
        </body>""",
    "classes of frames and bodies": f"""<body name="cabinet" childclass="out">{BOX}<frame childclass="side" pos="0 0 1">
        <body name="door" pos="1 0 0"><joint name="hinge"/><geom/><geom class="out"/>
        <frame childclass="out"><geom/></frame></body></frame><body pos="0 2 0"><geom/></body></body>""",
    "an attached body": f"""<body name="cabinet">{BOX}<frame pos="0 0 0.7" euler="90 0 0">
        <attach model="part" body="leaf" prefix="left_"/></frame></body>""",
    "an attached file": f'<body name="cabinet">{BOX}<attach model="part" prefix="left_"/></body>',
}


@pytest.mark.parametrize("case", PLACING)
def test_shapes_and_joints_are_where_mujoco_has_them(tmp_path: Path, case: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    assets = '<asset><model name="part" file="parts/part.xml"/></asset>' if "attach" in PLACING[case] else ""
    text = f"<mujoco>{CLASSES}{assets}<worldbody>{PLACING[case]}</worldbody></mujoco>"
    write(tmp_path / "cabinet.xml", text)
    if assets:
        write(tmp_path / "parts" / "part.xml", PART)
    (model,) = models(tmp_path)
    groups, _ = grouped(model)
    simulated = mujoco.MjModel.from_xml_path(str(tmp_path / "cabinet.xml"))
    data = mujoco.MjData(simulated)
    mujoco.mj_forward(simulated, data)
    expected = np.array(sorted(np.round(data.geom_xpos, 6).tolist()))
    np.testing.assert_allclose(centres(groups), expected, atol=2e-6)
    joints = [(group.joint, group.root_from_child) for group in groups if group.joint is not None]
    assert len(joints) == simulated.njnt
    anchors = [apply(pose, joint.anchor[None])[0] for joint, pose in joints]
    axes = [pose[:3, :3] @ joint.axis / np.linalg.norm(joint.axis) for joint, pose in joints]
    np.testing.assert_allclose(np.reshape(anchors, (-1, 3)), data.xanchor, atol=1e-6)
    np.testing.assert_allclose(np.reshape(axes, (-1, 3)), data.xaxis, atol=1e-6)
    ranges = [(joint.lower, joint.upper) for joint, _ in joints]
    np.testing.assert_allclose(np.reshape(ranges, (-1, 2)), simulated.jnt_range, atol=1e-6)


def test_a_door_in_a_frame_is_a_door(tmp_path: Path) -> None:
    text = (
        f'<mujoco><worldbody><body name="cabinet">{BOX}<frame pos="0 0 0.05">{DOOR}</frame></body></worldbody></mujoco>'
    )
    write(tmp_path / "in" / "cabinet.xml", text)
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    np.testing.assert_allclose(size_of(model), [0.4, 0.32, 0.65], atol=1e-6)
    np.testing.assert_allclose(model.joints[0].origin, [-0.19, -0.15, 0.35], atol=1e-6)  # y from -0.17 to 0.15
    assert record.joints == 1 and model.joints[0].upper == pytest.approx(np.radians(100))


def test_a_part_that_another_file_includes_is_no_model(tmp_path: Path) -> None:
    cabinet = f'<mujoco model="cabinet"><worldbody><body name="cabinet">{BOX}{DOOR}</body></worldbody></mujoco>'
    write(tmp_path / "in" / "parts" / "cabinet.xml", cabinet.replace("0 100", "0 1.7"))
    write(
        tmp_path / "in" / "scene.xml",
        '<mujoco><compiler angle="radian"/><include file="parts/cabinet.xml"/><worldbody/></mujoco>',
    )
    model, record = only(add(tmp_path / "in", tmp_path / "out"))
    assert record.source == "scene.xml" and model.joints[0].upper == pytest.approx(1.7)


def test_files_that_include_one_another_are_refused_and_not_lost(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        write(tmp_path / f"{name}.xml", f'<mujoco><include file="{other}.xml"/><worldbody/></mujoco>')
    assert [found.source for found in read(tmp_path) if isinstance(found, Unread)] == ["a.xml", "b.xml"]


def test_a_thing_that_stands_fast_in_the_world_is_a_model(tmp_path: Path) -> None:
    write(tmp_path / "table.xml", f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{BOX}</worldbody></mujoco>')
    (model,) = models(tmp_path)
    assert len(model.links[1].visual) == 1 and model.findings == ("geoms of type 'plane' are left out",)


def test_vertices_that_stand_in_the_file(tmp_path: Path) -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (0, 0.4) for y in (0, 0.3) for z in (0, 0.9))
    text = f"""<mujoco><asset><mesh name="m" vertex="{corners}"/><mesh name="b" builtin="sphere" params="3"/></asset>
    <worldbody><body name="chair"><geom type="mesh" mesh="m"/><geom type="mesh" mesh="b"/></body></worldbody>
    </mujoco>"""
    write(tmp_path / "in" / "chair.xml", text)
    model, record = only(add(tmp_path / "in", tmp_path / "out", front="-y"))
    np.testing.assert_allclose(size_of(model), [0.4, 0.3, 0.9], atol=1e-6)
    assert "mesh 'b' has neither file nor vertices (builtin=): left out" in record.findings


def body(inside: str, before: str = "") -> str:
    return f'<mujoco>{before}<worldbody><body name="cabinet">{BOX}{DOOR}{inside}</body></worldbody></mujoco>'


TOLD = {
    "composite": (
        body('<composite type="cable" count="9 1 1"><geom type="capsule" size="0.01"/><joint/></composite>'),
        "<composite> in <body> is not read: 1 <geom>, 1 <joint> in it left out",
    ),
    "flexcomp": (body('<flexcomp type="grid" count="3 3 1"/>'), "<flexcomp> in <body> is not read"),
    "unknown": (
        body(f"<turntable><body>{BOX}</body><body>{BOX}</body></turntable>"),
        "<turntable> in <body> is not read: 2 <body>, 2 <geom> in it left out",
    ),
    "in a frame": (body("<frame><lamp/></frame>"), "<lamp> in <frame> is not read"),
    "in the world": (body("").replace("<worldbody>", "<worldbody><lamp/>"), "<lamp> in <worldbody> is not read"),
    "deformable": (body("", "<deformable><flex/></deformable>"), "<deformable> in <mujoco> is not read"),
    "equality": (
        body("", '<equality><joint joint1="hinge" joint2="x"/><weld body1="elsewhere"/></equality>'),
        "1 of <equality> (joint) left out: what they hold together moves freely",
    ),
    "tendon": (
        body("", '<tendon><fixed name="t"><joint joint="hinge" coef="1"/></fixed></tendon>'),
        "1 of <tendon> (fixed) left out: what they couple moves freely",
    ),
    "texture": (
        body(
            '<geom type="box" size="0.1 0.1 0.1" material="oak"/>',
            '<asset><texture name="t" builtin="checker"/><material name="oak" texture="t"/></asset>',
        ),
        "texture of material 'oak' is not read: what it covers has one colour",
    ),
    "fitted to a mesh": (
        body('<geom type="box" mesh="m"/>', '<asset><mesh name="m" vertex="0 0 0 0.1 0 0 0 0.1 0 0 0 0.1"/></asset>'),
        "a box is fitted to mesh 'm' (type, mesh): the mesh itself is taken",
    ),
    "height field": (body('<geom type="hfield" hfield="h"/>'), "geoms of type 'hfield' are left out"),
}


@pytest.mark.parametrize("case", TOLD)
def test_what_is_left_out_is_told(tmp_path: Path, case: str) -> None:
    text, finding = TOLD[case]
    write(tmp_path / "cabinet.xml", text)
    (model,) = models(tmp_path)
    assert model.findings == (finding,)


def test_what_holds_no_shape_is_not_told(tmp_path: Path) -> None:
    before = """<option gravity="0 0 0"/><size/><visual/><statistic/><custom/><default><default class="a"/></default>
    <asset><texture name="t"/><material name="m" texture="t"/></asset><contact><exclude body1="a" body2="b"/></contact>
    <actuator><motor joint="hinge"/></actuator><sensor/><keyframe><key/></keyframe><equality/><tendon/>"""
    write(tmp_path / "cabinet.xml", body('<light/><camera/><inertial mass="1"/><site/><plugin/>', before))
    (model,) = models(tmp_path)
    assert model.findings == ()


def test_only_unknown_elements_are_no_model_and_told(tmp_path: Path) -> None:
    write(tmp_path / "cloth.xml", '<mujoco><worldbody><flexcomp type="grid"/></worldbody></mujoco>')
    (found,) = read(tmp_path)
    assert isinstance(found, Unread) and "<flexcomp> in <worldbody> is not read" in found.reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (body('<attach model="x"/>'), "model 'x' is not declared"),
        (body('<attach model="x" body="b"/>', '<asset><model name="x" file="y.xml"/></asset>'), "'y.xml' is not in"),
        (body('<replicate count="99999999"><replicate count="99999999"/></replicate>'), "more than 5000 elements"),
        (body('<frame euler="1 2"/>'), "euler: '1 2' is not 3 numbers"),
    ],
)
def test_what_cannot_be_placed_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, reason: str
) -> None:
    monkeypatch.setattr(mjcf_document, "MOST_ELEMENTS", 5000)
    write(tmp_path / "cabinet.xml", text)
    (found,) = read(tmp_path)
    assert isinstance(found, Unread) and reason in found.reason


def test_a_file_that_attaches_itself_is_refused(tmp_path: Path) -> None:
    attaching = body('<attach model="x"/>', '<asset><model name="x" file="cabinet.xml"/></asset>')
    write(tmp_path / "cabinet.xml", attaching)
    (found,) = read(tmp_path)
    assert isinstance(found, Unread) and "in a circle" in found.reason


@pytest.mark.parametrize("name", ["cabinet.xml", "cabinet.sdf", "cabinet.urdf"])
def test_very_many_bodies_are_refused_before_they_are_read(tmp_path: Path, name: str) -> None:
    count = limits.MOST_LINKS_OF_A_FILE + 1
    texts = {
        "cabinet.xml": f"<mujoco><worldbody>{f'<body>{BOX}</body>' * count}</worldbody></mujoco>",
        "cabinet.sdf": f'<sdf version="1.7">{"<model><link/></model>" * count}</sdf>',
        "cabinet.urdf": f"<robot>{'<link/>' * count}</robot>",
    }
    write(tmp_path / name, texts[name])
    with pytest.raises(BadInput, match=rf"{name}: {count} (bodies|links), more than \d+ \(split it"):
        add(tmp_path, tmp_path / "out", class_name="cabinet")
