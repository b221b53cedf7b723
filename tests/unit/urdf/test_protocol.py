"""`scenewright urdf protocol`: the same verdict for the same scene in every format and both engines."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenewright.cli.main import run
from scenewright.schemas.places import checkout

from tests.unit.simulation.handmade_scene import bottle, floor, table, write_scene
from tests.unit.urdf.other_scenes import DOOR, FRAME, TABLE, WRITERS, Block, cup, mjcf, sdf, urdf, wall

FILES = sorted(WRITERS)


@pytest.fixture(autouse=True)
def _with_mujoco(request: pytest.FixtureRequest) -> None:
    if "without_mujoco" not in request.fixturenames:
        pytest.importorskip("mujoco")


@pytest.fixture
def without_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)


@pytest.fixture
def judged(capsys: pytest.CaptureFixture[str]) -> Any:
    def judge(scene: Path, *more: str, code: int = 0) -> dict[str, Any]:
        assert run(["urdf", "protocol", str(scene), "--json", *more]) == code
        return dict(json.loads(capsys.readouterr().out))

    return judge


def in_engines(document: dict[str, Any], body: str, key: str) -> list[Any]:
    found = next(entry for entry in document["free_bodies"] if entry["name"] == body)
    return [found[engine][key] for engine in ("mujoco", "bullet")]


@pytest.mark.parametrize("file", FILES)
def test_a_cup_on_a_table_is_stable(file: str, tmp_path: Path, judged: Any) -> None:
    found = judged(WRITERS[file](tmp_path / file, [TABLE, cup(0.8)]))
    assert (found["bodies"], found["free"], found["stable"], found["stable_share"]) == (2, 1, 1, 1.0)
    assert found["sound"] and found["all_stable"] and not found["pairs"] and not found["findings"]
    assert max(in_engines(found, "cup", "moved_mm")) < 2.5


@pytest.mark.parametrize("file", FILES)
def test_a_cup_above_a_table_falls(file: str, tmp_path: Path, judged: Any) -> None:
    found = judged(WRITERS[file](tmp_path / file, [TABLE, cup(0.82), cup(0.8, "mug", 0.3)]), code=4)
    assert (found["stable"], found["stable_share"], found["all_stable"]) == (1, 0.5, False)
    assert in_engines(found, "cup", "moved_mm") == pytest.approx([20, 20], abs=2)
    assert in_engines(found, "cup", "stable") == [False, False] == in_engines(found, "cup", "stable_old")


@pytest.mark.parametrize("file", FILES)
def test_a_cup_in_a_table_collides(file: str, tmp_path: Path, judged: Any) -> None:
    found = judged(WRITERS[file](tmp_path / file, [TABLE, cup(0.77), cup(0.8, "mug", 0.3)]), code=4)
    assert [(pair["first"], pair["second"], pair["colliding"]) for pair in found["pairs"]] == [("cup", "table", True)]
    assert found["pairs"][0]["depth_mm"] == pytest.approx(30, abs=0.1)
    assert (found["colliding_pairs"], found["colliding_bodies"], found["colliding_share"]) == (1, 1, 0.5)


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize(("side", "share", "start"), [(-0.07, 0.785, True), (0.43, 0.06, False), (-2.0, 1.0, True)])
def test_a_door_opens_until_it_meets_a_wall(
    file: str, side: float, share: float, start: bool, tmp_path: Path, judged: Any
) -> None:
    """The wall's face is crossed when the door stands at right angles to it, at once, or never."""
    place = wall(side) if side < 0 else Block("wall", (0.1, 0.1, 0.5), (side - 0.1, 1.08, 0.3))
    found = judged(WRITERS[file](tmp_path / file, [FRAME, DOOR, place]), code=0 if start else 4)
    (sweep,) = found["sweeps"]
    assert (sweep["joint"], sweep["body"], sweep["free_at_start"]) == ("of_door", "frame", start)
    assert sweep["free_range_share"] == pytest.approx(share, abs=0.03)
    assert sweep["meets"] == (None if share == 1.0 else "wall")
    assert (found["joints"], found["joints_free"], found["joints_free_at_start"]) == (1, share == 1.0, start)


@pytest.mark.parametrize("file", FILES)
def test_what_falls_past_everything_falls_through(file: str, tmp_path: Path, judged: Any) -> None:
    found = judged(WRITERS[file](tmp_path / file, [TABLE, cup(0.8, x=3.0)]), code=4)
    assert in_engines(found, "cup", "fell_through") == [True, True]


def test_what_is_fixed_in_what_is_fixed_counts_apart(tmp_path: Path, judged: Any) -> None:
    found = judged(sdf(tmp_path / "scene.sdf", [TABLE, Block("shelf", (1, 1, 1), (0.9, 0.0, 0.5)), cup(0.8)]))
    assert (found["fixed_pairs"], found["colliding_pairs"], found["sound"]) == (1, 0, True)


def test_a_scene_folder_says_what_was_seen(tmp_path: Path, judged: Any) -> None:
    """A bottle that is fixed although it should be free is held; without scene.mjcf.xml MuJoCo has nothing to read."""
    fixed = bottle(0.1, 0.2, 0.75, "table_3", "supports", name="bottle_8")
    fixed.movable = False
    write_scene(tmp_path, [floor(), table(0.0, 0.0), bottle(0.0, 0.0, 0.75, "table_3", "supports"), fixed])
    found = judged(tmp_path)
    assert found["yield"] == {
        **{"seen": 3, "kept": 3, "kept_free": 1, "held": 1},
        **{"kept_share": 1.0, "free_share": 0.3333, "held_share": 0.3333},
    }
    assert found["held_bodies"] == ["bottle_8"]
    assert "scene.mjcf.xml is not there" in found["engines"]["mujoco"]["not_run"]
    assert judged(tmp_path, "--seen", "6")["yield"]["kept_share"] == 0.5


def test_what_is_in_a_drawer_rides_with_it(tmp_path: Path, judged: Any) -> None:
    """Ours says what a thing contains; of others' files the box of the thing tells: the back panel meets no cup."""
    text = (
        '<mujoco><worldbody><body name="chest" pos="0 0 .5"><geom type="box" size=".3 .3 .01" pos="0 0 -.1"/>'
        '<geom type="box" size=".3 .3 .01" pos="0 0 .1"/><body name="tray"><joint name="slide" type="slide"'
        ' axis="0 -1 0" range="0 .4"/><geom type="box" size=".25 .25 .01" pos="0 0 -.075"/>'
        '<geom type="box" size=".25 .01 .04" pos="0 .24 -.02"/></body></body>'
        '<body name="cup" pos="0 0 .465"><freejoint/><geom type="box" size=".03 .03 .03"/></body></worldbody></mujoco>'
    )
    (tmp_path / "scene.xml").write_text(text)
    found = judged(tmp_path / "scene.xml")
    assert [(sweep["joint"], sweep["meets"]) for sweep in found["sweeps"]] == [("slide", None)]


def test_near_a_limit_is_marginal_and_far_from_it_is_not(tmp_path: Path, judged: Any) -> None:
    found = judged(urdf(tmp_path / "scene.urdf", [TABLE, cup(0.81), cup(0.84, "mug", 0.3)]), code=4)
    assert found["engines"]["bullet"]["marginal"] == ["cup"] == found["engines"]["mujoco"]["marginal"]
    assert in_engines(found, "mug", "margin") == [None, None]


def test_old_limits_stand_beside_the_new_ones(tmp_path: Path, judged: Any) -> None:
    """A block that stands 3.4 degrees off level lies down: by 2 degrees it has left, by 5 it has not."""
    tilted = mjcf(tmp_path / "scene.xml", [TABLE, cup(0.8031)])
    tilted.write_text(tilted.read_text().replace('<body name="cup"', '<body name="cup" euler="0.06 0 0"'))
    found = judged(tilted)
    assert in_engines(found, "cup", "turned_deg") == pytest.approx([3.44, 3.44], abs=0.2)
    assert in_engines(found, "cup", "stable") == [True, True]
    assert in_engines(found, "cup", "stable_old") == [False, False]
    assert [found["engines"][engine]["stable_old"] for engine in ("mujoco", "bullet")] == [0, 0]
    assert found["limits"] == {
        **{"gravity": 9.81, "seconds": 5.0, "moved_mm": 10.0, "turned_deg": 5.0, "depth_mm": 5.0, "start_share": 0.1}
    }
    assert found["old_limits"] == {"seconds": 3.0, "moved_mm": 10.0, "turned_deg": 2.0}


def test_what_an_engine_loses_is_not_stable(tmp_path: Path, judged: Any) -> None:
    """MuJoCo would begin anew when its numbers break, and everything would lie where it was."""
    more = '<equality/><option timestep="0.01"/>'
    file = mjcf(tmp_path / "scene.xml", [TABLE, cup(0.8)], more)
    spring = (
        '<body name="wild" pos="3 0 0"><joint type="slide" axis="0 0 1" stiffness="-1e9"/>'
        '<geom type="box" size=".1 .1 .1"/></body></worldbody>'
    )
    file.write_text(file.read_text().replace("</worldbody>", spring))
    found = judged(file, code=4)
    assert in_engines(found, "cup", "stable") == [False, True]
    assert in_engines(found, "cup", "moved_mm")[0] is None
    assert not (Path.cwd() / "MUJOCO_LOG.TXT").exists()


def test_the_first_key_frame_is_the_state(tmp_path: Path, judged: Any) -> None:
    key = '<keyframe><key name="a" qpos="0 0 .85 1 0 0 0"/><key name="b" qpos="0 0 9 1 0 0 0"/></keyframe>'
    found = judged(mjcf(tmp_path / "scene.xml", [TABLE, cup(2.0)], key))
    assert found["stable"] == 1


def test_round_shapes_are_round_in_both_engines(tmp_path: Path, judged: Any) -> None:
    """A ball drops by its gap; what stands on a plane does not fall through it."""
    bodies = (
        '<geom type="plane" size="1 1 .1"/>'
        '<body name="ball" pos="1 0 .12"><freejoint/><geom type="sphere" size=".1"/></body>'
        '<body name="can" pos="2 0 .1"><freejoint/><geom type="cylinder" size=".05 .1"/></body>'
        '<body name="pill" pos="3 0 .05"><freejoint/><geom type="capsule" size=".05 .1" euler="0 1.5707963 0"/></body>'
    )
    file = mjcf(tmp_path / "scene.xml", [TABLE, cup(0.8)])
    file.write_text(file.read_text().replace("<worldbody>", f"<worldbody>{bodies}"))
    found = judged(file, code=4)
    assert in_engines(found, "ball", "moved_mm") == pytest.approx([20, 20], abs=2)
    assert [body["name"] for body in found["free_bodies"] if body["stable"]] == ["can", "pill", "cup"]
    assert not any(in_engines(found, "ball", "fell_through"))


def test_without_mujoco_bullet_runs_and_a_line_says_so(tmp_path: Path, judged: Any, without_mujoco: None) -> None:
    found = judged(urdf(tmp_path / "scene.urdf", [TABLE, cup(0.8)]))
    assert found["stable"] == 1 and "not installed" in found["engines"]["mujoco"]["not_run"]
    assert run(["urdf", "protocol", str(mjcf(tmp_path / "scene.xml", [TABLE, cup(0.8)]))]) == 5


def test_json_and_picture_have_the_same_bytes_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = urdf(tmp_path / "scene.urdf", [TABLE, cup(0.77), FRAME, DOOR])
    for folder in ("a", "b", "b"):
        assert run(["urdf", "protocol", str(scene), "--seen", "4", "--out", str(tmp_path / folder)]) == 4
    written = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert sorted(written) == ["protocol.json", "protocol.png"]
    assert written == {path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()}
    assert sorted(path.name for path in tmp_path.iterdir() if not path.name.startswith(".")) == ["a", "b", "scene.urdf"]
    lines = capsys.readouterr().out
    assert "stable (5 s, 1 cm, 5 degrees)" in lines and "by the old limits (3 s, 1 cm, 2 degrees)" in lines
    assert "2 of 4 (50.0 %) things seen are in the scene, 1 of 4 (25.0 %) free" in lines
    assert "cup: 30.0 mm in table" in lines


def test_the_page_defines_every_number(tmp_path: Path, judged: Any) -> None:
    root = checkout()
    if root is None:
        pytest.skip("docs are in a checkout")
    page = (root / "docs" / "FORMATS.md").read_text().split("\n## A protocol for scenes\n")[1].split("\n## ")[0]
    found = judged(urdf(tmp_path / "scene.urdf", [TABLE, cup(0.77), FRAME, DOOR]), code=4)
    names = set(found) | set(found["yield"]) | set(found["engines"]["bullet"]) | set(found["limits"])
    names |= set(found["pairs"][0]) | set(found["sweeps"][0]) | set(found["free_bodies"][0]["bullet"])
    assert [name for name in sorted(names) if f"`{name}`" not in page] == []
    prose = re.sub(r"```.*?```", "", page, flags=re.DOTALL)
    assert len(re.findall(r"[\w`][\w`.]*", prose)) <= 500


# --- what is refused ------------------------------------------------------------------------------------------------

MESH = {
    "scene.urdf": '<link name="x"><collision><geometry><mesh filename="gone/vase.stl"/></geometry></collision></link>'
    '<joint name="jx" type="fixed"><parent link="world"/><child link="x"/></joint>',
    "scene.xml": '<asset><mesh name="m" file="gone/vase.stl"/></asset>',
    "scene.sdf": '<model name="x"><static>1</static><link name="x"><collision name="c"><geometry><mesh>'
    "<uri>gone/vase.stl</uri></mesh></geometry></collision></link></model>",
}


@pytest.mark.parametrize("file", FILES)
def test_a_missing_mesh_is_named(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = WRITERS[file](tmp_path / file, [TABLE, cup(0.8)], MESH[file])
    out = tmp_path / "out"
    assert run(["urdf", "protocol", str(scene), "--out", str(out)]) == 3
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1 and "gone/vase.stl" in said[0] and str(scene) in said[0]
    assert not out.exists()


VASE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)]) * 0.1
"""Corners of a mesh, with one more that is deep in their hull."""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with meshes beside the scenes' own, one of them hollow."""
    for folder in ("meshes", "scenes"):
        (tmp_path / folder).mkdir()
    faces = trimesh.convex.convex_hull(VASE).faces
    hollow = trimesh.Trimesh([*VASE, [0, 0, 0.06]], [*faces, [0, 1, 8], [1, 2, 8]], process=False)
    hollow.export(tmp_path / "meshes" / "vase.stl")
    return tmp_path


@pytest.mark.parametrize("file", ["scene.urdf", "scene.sdf"])
def test_meshes_lie_in_the_root_and_hollow_ones_are_told(file: str, package: Path, judged: Any) -> None:
    more = MESH[file].replace("gone/vase.stl", "package://vases/meshes/vase.stl")
    scene = WRITERS[file](package / "scenes" / file, [TABLE, cup(0.8)], more)
    assert run(["urdf", "protocol", str(scene)]) == 3
    assert run(["urdf", "protocol", str(scene), "--root", str(package / "meshes")]) == 2
    found = judged(scene, "--root", str(package))
    assert found["bodies"] == 3 and found["fixed_pairs"] == 1  # it stands where the table does
    assert any("vase.stl' collides as its hull, up to 40 mm off its surface" in line for line in found["findings"])


def test_mjcf_says_itself_where_its_files_lie(package: Path, judged: Any) -> None:
    (package / "meshes" / "vase.xml").write_text('<mujocoinclude><mesh name="vase" file="vase.stl"/></mujocoinclude>')
    more = '<asset><include file="../meshes/vase.xml"/></asset><compiler meshdir="../meshes"/>'
    scene = mjcf(package / "scenes" / "scene.xml", [TABLE, cup(0.8)], more)
    vase = '<body name="vase" pos="3 0 0"><freejoint/><geom type="mesh" mesh="vase"/></body></worldbody>'
    scene.write_text(scene.read_text().replace("</worldbody>", vase))
    found = judged(scene, code=4)
    assert (found["free"], found["stable"]) == (2, 1) and in_engines(found, "vase", "fell_through") == [True, True]
    (package / "meshes" / "vase.stl").unlink()
    assert run(["urdf", "protocol", str(scene)]) == 3
    (package / "meshes" / "vase.xml").unlink()
    assert run(["urdf", "protocol", str(scene)]) == 3


def test_a_static_model_needs_no_inertia(tmp_path: Path, judged: Any) -> None:
    scene = sdf(tmp_path / "scene.sdf", [TABLE, cup(0.8)])
    scene.write_text(re.sub(r"<ixx>.*?</izz>", "<ixx>0</ixx><iyy>0</iyy><izz>0</izz>", scene.read_text(), count=1))
    assert judged(scene)["sound"]


UNKNOWN = {"scene.urdf": "<hologram/>", "scene.sdf": "<hologram/>"}


@pytest.mark.parametrize("file", sorted(UNKNOWN))
def test_unknown_elements_are_findings(file: str, tmp_path: Path, judged: Any) -> None:
    found = judged(WRITERS[file](tmp_path / file, [TABLE, cup(0.8)], UNKNOWN[file]))
    assert len(found["findings"]) == 1 and "hologram" in found["findings"][0]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("scene.usda", "#usda 1.0", "does not read USD"),
        ("scene.xml", "<html/>", "root element is <html>"),
        ("scene.xml", "<mujoco><worldbody><hologram/></worldbody></mujoco>", "hologram"),
        ("scene.xml", '<mujoco><option gravity="0 -9.81 0"/><worldbody/></mujoco>', "not along -z"),
        ("scene.urdf", '<robot name="r"><link name="a"/><link name="b"/></robot>', "2 links hang on nothing"),
        (
            "scene.urdf",
            '<robot name="r"><link name="a"/><link name="b"><collision><geometry><sphere radius=".1"/></geometry>'
            '</collision></link><joint name="j" type="floating"><parent link="a"/><child link="b"/></joint></robot>',
            "link 'b' can move and has no mass",
        ),
        ("scene.sdf", '<sdf version="1.9"><world name="a"/><world name="b"/></sdf>', "2 worlds"),
        ("scene.sdf", '<sdf version="1.9"><world name="a"><gravity>9 0 0</gravity></world></sdf>', "not along -z"),
        ("scene.urdf", '<robot name="r">', "XML"),
    ],
)
def test_what_is_no_scene_is_refused_in_one_line(
    name: str, text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(text)
    assert run(["urdf", "protocol", str(tmp_path / name)]) == 3
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and said in lines[0] and name in lines[0]


def test_a_folder_without_a_scene_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["urdf", "protocol", str(tmp_path)]) == 3
    assert "there is no scene.json in it (name a folder" in capsys.readouterr().err


def test_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = urdf(tmp_path / "scene.urdf", [TABLE, cup(0.8)])
    assert run(["urdf", "protocol", str(scene), "--seen", "0"]) == 2
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "thesis.tex").write_text("all of it")
    assert run(["urdf", "protocol", str(scene), "--out", str(kept)]) == 2
    assert "thesis.tex" in capsys.readouterr().err and (kept / "thesis.tex").read_text() == "all of it"
    two = urdf(tmp_path / "two.urdf", [TABLE, cup(0.8), cup(0.8, "mug", 0.3)])
    assert run(["urdf", "protocol", str(two), "--seen", "1"]) == 2
    assert "the scene holds 2 things" in capsys.readouterr().err
