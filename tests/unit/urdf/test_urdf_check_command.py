"""`scenewright urdf check`: a line for each finding, exit code 3, and links that lie in each other at rest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from scenewright.cli.main import run
from scenewright.stages.urdf.rest_penetration import resting_penetrations

BOX = (
    '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>'
)


def two_boxes(path: Path, joint: str, height: float, limits: str = "") -> Path:
    path.write_text(
        f'<robot name="two"><link name="table">{BOX}</link><link name="cup">{BOX}</link>'
        f'<joint name="j" type="{joint}"><parent link="table"/><child link="cup"/>'
        f'<origin xyz="0 0 {height}"/><axis xyz="0 0 1"/>{limits}</joint></robot>'
    )
    return path


@pytest.mark.parametrize(("joint", "height", "depth"), [("floating", 0.17, 0.03), ("floating", 0.199, 0.0)])
def test_a_cup_may_stand_on_a_table_and_not_in_it(tmp_path: Path, joint: str, height: float, depth: float) -> None:
    found = resting_penetrations(two_boxes(tmp_path / "two.urdf", joint, height), 0.005)
    assert [(p.first, p.second) for p in found] == ([("table", "cup")] if depth else [])
    assert all(p.depth == pytest.approx(depth, abs=0.002) for p in found)


def test_a_door_may_touch_its_frame(tmp_path: Path) -> None:
    limits = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    assert resting_penetrations(two_boxes(tmp_path / "two.urdf", "revolute", 0.1, limits), 0.005) == []


def test_joints_rest_at_the_limit_nearest_to_zero(tmp_path: Path) -> None:
    """A lift whose range begins at 30 cm does not rest in the floor below it."""
    limits = '<limit lower="0.3" upper="1" effort="1" velocity="1"/>'
    file = two_boxes(tmp_path / "lift.urdf", "prismatic", 0.0, limits)
    text = file.read_text().replace(
        "</robot>",
        f'<link name="floor">{BOX}</link><joint name="f" type="floating"><parent link="table"/><child link="floor"/>'
        '<origin xyz="0 0 0.22"/></joint></robot>',
    )
    file.write_text(text)
    assert [(p.first, p.second) for p in resting_penetrations(file, 0.005)] == [("cup", "floor")]
    file.write_text(text.replace('lower="0.3"', 'lower="0.5"'))
    assert resting_penetrations(file, 0.005) == []


def test_findings_are_lines_and_exit_with_3(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    good = two_boxes(tmp_path / "good.urdf", "floating", 0.2)
    assert run(["urdf", "check", str(good)]) == 0
    assert capfd.readouterr().out == f"{good}: sound\n"
    deep = two_boxes(tmp_path / "deep.urdf", "floating", 0.15)
    assert run(["urdf", "check", str(deep)]) == 3
    line = capfd.readouterr().out
    assert line.startswith(f"{deep}: link 'table': lies ") and line.count("\n") == 1
    broken = tmp_path / "broken.urdf"
    broken.write_text(good.read_text().replace('mass value="1"', 'mass value="-1"'))
    assert run(["urdf", "check", str(broken), "--json"]) == 3
    document = json.loads(capfd.readouterr().out)
    assert not document["sound"] and {f["kind"] for f in document["findings"]} == {"mass"}


def test_a_missing_file_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["urdf", "check", str(tmp_path / "none.urdf")]) == 3
    out, err = capfd.readouterr()
    assert (out + err).count("\n") == 1


@pytest.mark.parametrize(
    ("geometry", "lines"),
    [
        ('<cylinder radius="0.1" length="0.2"/>', []),
        ('<sphere radius="-1"/>', ["link 'cup': sphere of size (-1.0,)"]),
        ('<cone radius="1"/>', ["link 'cup': URDF has no shape <cone>"]),
        ('<capsule radius="0" length="1"/>', ["link 'cup': capsule of size (0.0, 1.0)"]),
    ],
)
def test_shapes_without_size_and_of_no_kind(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], geometry: str, lines: list[str]
) -> None:
    file = two_boxes(tmp_path / "two.urdf", "floating", 0.3)
    text, at = file.read_text(), file.read_text().rindex('<box size="0.2 0.2 0.2"/>')
    file.write_text(text[:at] + geometry + text[at + len('<box size="0.2 0.2 0.2"/>') :])
    assert run(["urdf", "check", str(file)]) == (3 if lines else 0)
    assert capfd.readouterr().out.splitlines() == [f"{file}: {line}" for line in lines or ["sound"]]


def test_advice_on_capsules_and_unknown_elements(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = two_boxes(tmp_path / "two.urdf", "floating", 0.5)
    text = file.read_text().replace("</robot>", "<wheel><link/></wheel></robot>")
    file.write_text(text.replace('<box size="0.2 0.2 0.2"/>', '<capsule radius="0.05" length="0.1"/>', 1))
    assert run(["urdf", "check", str(file)]) == 0
    assert capfd.readouterr().out.splitlines() == [
        f"{file}: sound",
        f"{file}: advice: link 'table': a capsule is newer than many readers of URDF, which leave it out",
        f"{file}: advice: robot: <wheel> in <robot> is not read: 1 <link> in it left out",
    ]


@pytest.mark.parametrize(
    "name", ["package://shop/meshes/cup.obj", "file:///opt/shop/meshes/cup.obj", "/meshes/cup.obj"]
)
def test_the_path_that_is_advised_for_a_package_is_sound(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "meshes" / "cup.obj")
    file = two_boxes(tmp_path / "two.urdf", "floating", 0.5)
    text = file.read_text()
    file.write_text(text.replace('<box size="0.2 0.2 0.2"/>', f'<mesh filename="{name}"/>', 1))
    assert run(["urdf", "check", str(file)]) == 3
    assert capfd.readouterr().out.rstrip().endswith("; write 'meshes/cup.obj'")
    file.write_text(text.replace('<box size="0.2 0.2 0.2"/>', '<mesh filename="meshes/cup.obj"/>', 1))
    assert run(["urdf", "check", str(file)]) == 0
    file.write_text(text.replace('<box size="0.2 0.2 0.2"/>', '<mesh filename="package://shop/gone.obj"/>', 1))
    assert run(["urdf", "check", str(file)]) == 3
    assert "not found there by its end" in capfd.readouterr().out
