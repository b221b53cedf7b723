"""SDF: axes and poses of every version, frames, models in models, and what is told instead of read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.library.importing.discovery import Unread, find_models
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel

from tests.unit.library.test_addition import add, dae, size_of, write


def visual(size: str, pose: str = "0 0 0 0 0 0") -> str:
    return f'<visual name="v"><pose>{pose}</pose><geometry><box><size>{size}</size></box></geometry></visual>'


BODY = f'<link name="body"><pose>0 0 0.3 0 0 0</pose>{visual("0.4 0.3 0.6")}</link>'
LEAF = visual("0.4 0.02 0.6", "0.2 -0.01 0 0 0 0")
"""A door of 0.4 x 0.02 x 0.6 on a body of 0.4 x 0.3 x 0.6; it hangs at its left front edge (-0.2, -0.15, 0.3)."""
LIMIT = "<limit><lower>0</lower><upper>1.5</upper></limit>"
QUARTER = np.pi / 2


def sdf(inside: str, version: str = "1.7", before: str = "") -> str:
    return f'<sdf version="{version}">{before}<model name="cabinet"><pose>9 9 9 0 0 1</pose>{inside}</model></sdf>'


def hinge(
    ends: str = "<parent>body</parent><child>door</child>", axis: str = "<xyz>0 0 1</xyz>", pose: str = ""
) -> str:
    return f'<joint name="hinge" type="revolute">{pose}{ends}<axis>{axis}{LIMIT}</axis></joint>'


def door(pose: str, leaf: str = LEAF) -> str:
    return f'<link name="door">{pose}{leaf}</link>'


AT = "<pose>-0.2 -0.15 0.3 0 0 0</pose>"
PLAIN = f"{BODY}{door(AT)}{hinge()}"
LYING = f"<pose>-0.2 -0.15 0.3 {-QUARTER} 0 0</pose>"
"""The door's frame lies on its back: its z is the model's y."""
LYING_LEAF = visual("0.4 0.6 0.02", "0.2 0 -0.01 0 0 0")
INNER_DOOR = door("<pose>-0.2 -0.15 0.2 0 0 0</pose>")
INNER = (
    f"""<model name="inner"><pose>0 0 0.1 0 0 0</pose>{BODY.replace("0 0 0.3", "0 0 0.2")}{INNER_DOOR}{{}}</model>"""
)
CASES = {
    "plain": PLAIN,
    "axis of 1.4": (f"{BODY}{door(LYING, LYING_LEAF)}{hinge()}", "1.4"),
    "axis of 1.5": (f"{BODY}{door(LYING, LYING_LEAF)}{hinge(axis='<xyz>0 -1 0</xyz>')}", "1.5"),
    "axis in the model": (
        f"{BODY}{door(LYING, LYING_LEAF)}"
        f"{hinge(axis='<xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame>')}",
        "1.6",
    ),
    "axis in the model, since 1.7": (
        f"{BODY}{door(LYING, LYING_LEAF)}"
        f"{hinge(axis='<xyz>0 -1 0</xyz><use_parent_model_frame>1</use_parent_model_frame>')}",
        "1.7",
    ),
    "axis in another link": f"{BODY}{door(LYING, LYING_LEAF)}{hinge(axis='<xyz expressed_in=~body~>0 0 1</xyz>')}",
    "no version": (f"{BODY}{door(LYING, LYING_LEAF)}{hinge(axis='<xyz>0 -1 0</xyz>')}", ""),
    "link in its joint, as gz sdf -p writes": f"{BODY}{door('<pose relative_to=~hinge~>0 0 0 0 0 0</pose>')}"
    f"{hinge(pose='<pose relative_to=~body~>-0.2 -0.15 0 0 0 0</pose>')}",
    "links out of order": f"{door('<pose relative_to=~body~>-0.2 -0.15 0 0 0 0</pose>')}{BODY}{hinge()}",
    "frames of frames": f"""<frame name="edge" attached_to="body"><pose relative_to="corner">0 0 0.3 0 0 0</pose>
        </frame><frame name="corner" attached_to="body"><pose>-0.2 -0.15 -0.3 0 0 0</pose></frame>{BODY}
        {door("<pose relative_to='edge'/>")}{hinge()}""",
    "joint between frames": f"""<frame name="edge" attached_to="body"/><frame name="leaf" attached_to="door"/>{BODY}
        {door(AT)}{hinge("<parent>edge</parent><child>leaf</child>")}""",
    "attribute frame": (f"{BODY}{door('<pose frame=~body~>-0.2 -0.15 0 0 0 0</pose>')}{hinge()}", "1.6"),
    "empty attribute frame": (f"{BODY}{door(AT.replace('<pose', '<pose frame=~~'))}{hinge()}", "1.6"),
    "degrees": f"{BODY}{door('<pose degrees=~true~>-0.2 -0.15 0.3 -90 0 0</pose>', LYING_LEAF)}"
    f"{hinge(axis='<xyz>0 -1 0</xyz>')}",
    "quaternion": f"{BODY}{door('<pose rotation_format=~quat_xyzw~>-0.2 -0.15 0.3 -1 0 0 1</pose>', LYING_LEAF)}"
    f"{hinge(axis='<xyz>0 -1 0</xyz>')}",
    "shape in another frame": f"""{BODY}<link name="door">{AT}<visual name="v"><pose relative_to="body">0 -0.16 0 0 0 0
        </pose><geometry><box><size>0.4 0.02 0.6</size></box></geometry></visual></link>{hinge()}""",
    "model in the model": INNER.format(hinge()),
    "joint into the model": INNER.format("") + hinge("<parent>inner::body</parent><child>inner::door</child>"),
    "model as an end": INNER.format("").replace('name="inner"', 'name="inner" canonical_link="body"')
    + hinge("<parent>inner</parent><child>inner::door</child>"),
    "weld to a model": f"""<link name="base"/>{INNER.format(hinge())}<joint name="weld" type="fixed">
        <parent>base</parent><child>inner::body</child></joint>""",
    "placement frame": INNER.format(hinge())
    .replace('name="inner"', 'name="inner" placement_frame="door"')
    .replace("<pose>0 0 0.1 0 0 0</pose>", "<pose>-0.2 -0.15 0.3 0 0 0</pose>", 1),
    "included": f"""{BODY}<include><uri>model://leaf</uri><name>left</name>{AT}</include>
        {hinge("<parent>body</parent><child>left::door</child>")}""",
    "merged": f'{BODY}<include merge="true"><uri>model://leaf</uri>{AT}</include>{hinge()}',
}


def written(folder: Path, case: str | tuple[str, str]) -> None:
    inside, version = case if isinstance(case, tuple) else (case, "1.11")
    write(folder / "cabinet.sdf", sdf(inside.replace("~", '"'), version))
    if "model://leaf" in inside:
        leaf = f'<sdf version="1.4"><model name="leaf"><pose>7 7 7 0 0 0</pose>{door("")}</model></sdf>'
        write(folder / "leaf" / "old.sdf", leaf.replace("0.02", "9"))
        write(folder / "leaf" / "new.sdf", leaf)
        entries = '<sdf version="1.3">old.sdf</sdf><sdf version="1.10">new.sdf</sdf><sdf version="1.9">old.sdf</sdf>'
        write(folder / "leaf" / "model.config", f"<model>{entries}</model>")


@pytest.mark.parametrize("case", CASES)
def test_the_door_hangs_where_it_hangs(tmp_path: Path, case: str) -> None:
    written(tmp_path / "in", CASES[case])
    library = add(tmp_path / "in", tmp_path / "out", mapping='[models]\n"*old*" = "skip"\n"leaf*" = "skip"')
    (model,) = library.info.models
    np.testing.assert_allclose(size_of(model), [0.4, 0.32, 0.6], atol=1e-6)
    (joint,) = model.joints
    # across, the whole is 0.32 deep: from -0.17 to 0.15
    np.testing.assert_allclose(joint.origin, [-0.2, -0.14, 0.3], atol=1e-6)
    np.testing.assert_allclose(joint.axis, [0, 0, 1], atol=1e-6)
    assert (joint.lower, joint.upper) == (0.0, 1.5)


def read(folder: Path) -> list[SourceModel | Unread]:
    return list(find_models(SourceFolder(folder)))


TOLD = {
    "unknown in the model": (
        PLAIN + "<wheel><link/><link/></wheel>",
        "<wheel> in <model> is not read: 2 <link> in it left out",
    ),
    "unknown in a link": (PLAIN.replace(LEAF, LEAF + "<trail/>"), "<trail> in <link> is not read"),
    "unknown in a joint": (PLAIN.replace("<axis>", "<spring/><axis>"), "<spring> in <joint> is not read"),
    "unknown shape": (
        PLAIN.replace(LEAF, f'{LEAF}<visual name="w"><geometry><heightmap/></geometry></visual>'),
        "a shape of link 'door' is left out: <heightmap>",
    ),
    "empty shape": (
        PLAIN.replace(LEAF, f'{LEAF}<visual name="w"><geometry/></visual>'),
        "a shape of link 'door' is left out: it is empty",
    ),
    "mimic": (
        PLAIN.replace(LIMIT, f'{LIMIT}<mimic joint="other"><multiplier>1</multiplier></mimic>'),
        "joint 'hinge' follows joint 'other' (mimic): here both move freely",
    ),
    "script": (
        PLAIN.replace("</visual>", "<material><script><name>Gazebo/Wood</name></script></material></visual>", 1),
        "material script 'Gazebo/Wood' is not read: what it covers has one colour",
    ),
    "texture": (
        PLAIN.replace(
            "</visual>", "<material><pbr><metal><albedo_map>a.png</albedo_map></metal></pbr></material></visual>", 1
        ),
        "texture 'a.png' is not read: what it covers has one colour",
    ),
    "use_parent_model_frame of 1.7": (
        PLAIN.replace(LIMIT, f"<use_parent_model_frame>true</use_parent_model_frame>{LIMIT}"),
        "joint 'hinge': use_parent_model_frame means nothing since SDF 1.7: its axis is in its own frame",
    ),
    "ball": (PLAIN.replace("revolute", "ball"), "joint 'hinge' is of type 'ball': held fast"),
    "not in the folder": (
        f"{PLAIN}<include><uri>model://far</uri></include>",
        "included model 'model://far' is not in the folder, or is not an SDF: left out",
    ),
    "no submesh": (
        PLAIN.replace(
            LEAF,
            "<visual name='v'><geometry><mesh><uri>meshes/a.dae</uri><submesh><name>nut</name></submesh></mesh>"
            "</geometry>"
            "</visual>",
        ),
        "link 'door': submesh 'nut' is not in its mesh: all of it is taken",
    ),
}


@pytest.mark.parametrize("case", TOLD)
def test_what_is_left_out_is_told(tmp_path: Path, case: str) -> None:
    inside, finding = TOLD[case]
    write(tmp_path / "cabinet.sdf", sdf(inside))
    write(tmp_path / "meshes" / "a.dae", dae(1.0, "Z_UP", (0.4, 0.02, 0.6)))
    (model,) = read(tmp_path)
    assert isinstance(model, SourceModel) and finding in model.findings
    assert len([line for line in model.findings if "named elsewhere" not in line]) == 1


def test_what_holds_no_shape_is_not_told(tmp_path: Path) -> None:
    inside = (
        PLAIN.replace(LEAF, LEAF + "<sensor name='s'/><light/><gravity>0</gravity>") + "<plugin/><static>1</static>"
    )
    write(tmp_path / "cabinet.sdf", sdf(inside, before="<light/>"))
    (model,) = read(tmp_path)
    assert isinstance(model, SourceModel) and model.findings == ()


def test_what_lies_in_a_world_beside_its_models(tmp_path: Path) -> None:
    models = f'<model name="cabinet">{PLAIN}</model>'
    world = "<include><uri>model://bed</uri></include><include><uri>model://leaf</uri></include><actor><link/></actor>"
    write(tmp_path / "room.world", f'<sdf version="1.6"><world><physics/><gui/>{models}{world}</world></sdf>')
    write(tmp_path / "leaf" / "model.sdf", f'<sdf version="1.4"><model name="leaf">{door("")}</model></sdf>')
    leaf, cabinet, beside = read(tmp_path)
    assert isinstance(leaf, SourceModel) and isinstance(cabinet, SourceModel) and cabinet.findings == ()
    assert isinstance(beside, Unread)
    assert "included model 'model://bed' is not in the folder; <actor> in <world> is not read" in beside.reason


def test_older_versions_of_a_model_are_no_models(tmp_path: Path) -> None:
    for name, version in (("model", "1.6"), ("model-1_4", "1.4"), ("model-1_10", "1.10")):
        write(tmp_path / f"{name}.sdf", sdf(PLAIN, version))
    entries = "".join(f'<sdf version="{v}">{n}.sdf</sdf>' for n, v in (("model", "1.6"), ("model-1_4", "1.4")))
    write(tmp_path / "model.config", f"<model>{entries}</model>")
    assert [found.source for found in read(tmp_path)] == ["model-1_10.sdf", "model.sdf"]  # one is in no list


@pytest.mark.parametrize(
    ("inside", "reason"),
    [
        (f'{BODY}{door("<pose relative_to=~shelf~/>")}', "'shelf' does not exist in the model"),
        (f'<frame name="a"><pose relative_to="b"/></frame><frame name="b"><pose relative_to="a"/></frame>{BODY}'
         f'{door("<pose relative_to=~a~/>")}', "relative to one another in a circle"),
        (f"{BODY}{hinge()}", "'door' does not exist in the model"),
        (f'<frame name="a" attached_to="b"/><frame name="b" attached_to="a"/>{BODY}'
         f'{hinge("<parent>body</parent><child>a</child>")}', "'a' is attached to no link"),
        ("<include><uri>model://cabinet.sdf</uri></include>", "nested too deeply, or include one another"),
    ],
)  # fmt: skip
def test_names_that_lead_nowhere(tmp_path: Path, inside: str, reason: str) -> None:
    write(tmp_path / "cabinet.sdf", sdf(inside.replace("~", '"')))
    (found,) = read(tmp_path)
    assert isinstance(found, Unread) and reason in found.reason


def test_a_submesh_is_taken_alone_and_moved_to_the_middle(tmp_path: Path) -> None:
    mesh = "<mesh><uri>meshes/a.dae</uri><submesh><name>same</name><center>true</center></submesh></mesh>"
    shape = f'<visual name="v"><pose>0 0.2 0 0 0 1</pose><geometry>{mesh}</geometry></visual>'
    inside = f'<link name="a"><pose>0 0 1 0 0 0</pose>{shape}</link>'
    write(tmp_path / "cabinet.sdf", sdf(inside))
    write(tmp_path / "meshes" / "a.dae", dae(1.0, "Z_UP", (0.4, 0.3, 0.6)))
    (model,) = read(tmp_path)
    assert isinstance(model, SourceModel)
    points = model.links[0].visual[0].vertices
    np.testing.assert_allclose(0.5 * (points.min(axis=0) + points.max(axis=0)), [0, 0.2, 0], atol=1e-9)
