"""URDF and XML that cannot be, size, circles, entities in any encoding, names as paths."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.formats.urdf_check import check_urdf, require_sound
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.formats.xml_files import parse_xml
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.motion.convex_pieces import ConvexPiece
from scenewright.stages.kit.simulation.urdf_split import read_urdf

from tests.bad_input.broken_urdf import BROKEN, HINGE, INERTIA, inertial, joint, link, mesh, robot

LINK = f'<link name="%s">{INERTIA}</link>'


def kinds(tmp_path: Path, text: str | bytes) -> set[str]:
    path = tmp_path / "a.urdf"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return {problem.kind for problem in check_urdf(path)}


def hinges(**drivers: str) -> str:
    """Return a robot of two hinges, j and k, of which some follow others."""

    def hinge(name: str, parent: str, child: str) -> str:
        mimic = f'<mimic joint="{drivers[name]}"/>' if name in drivers else ""
        return joint(HINGE + mimic, name=name, parent=parent, child=child)

    return robot(LINK % "c", hinge("j", "a", "b") + hinge("k", "b", "c"))


ALONE = '<robot name="r"><link name="a"/>' + joint("", "fixed", "j", "a", "a") + "</robot>"
FOUND: dict[str, tuple[str, set[str]]] = {
    **{fault: (text, {kind}) for fault, (text, kind) in BROKEN.items()},
    "its own parent, alone": (ALONE, {"cycle", "roots"}),
    "its own parent": (robot("", joint() + joint("", "fixed", "k", "b", "b")), {"cycle"}),
    "follows itself": (hinges(j="j"), {"mimic"}),
    "each follows the other": (hinges(j="k", k="j"), {"mimic"}),
    "follows nobody that is there": (hinges(j="nobody"), {"mimic"}),
    "follows no name": (hinges(j=""), {"mimic"}),
    **{f"inertia of {value}": (link(inertial("1", value, value, value)), {"inertia"}) for value in ("-1", "0")},
    **{
        f"inertia of {value}": (link(inertial("1", value, value, value)), {kind})
        for value, kind in (("1e308", "inertia"), ("1e200", "inertia"), ("inf", "not_finite"))
    },
}
"""Fault -> (URDF, problems that are among those found)."""


@pytest.mark.parametrize("fault", FOUND)
def test_every_fault_is_found(tmp_path: Path, fault: str) -> None:
    text, problems = FOUND[fault]
    for path in (tmp_path / "inside" / "m.obj", tmp_path / "outside.obj"):
        path.parent.mkdir(exist_ok=True)
        path.write_text("v 0 0 0\n")
    assert problems <= kinds(tmp_path / "inside", text)
    with pytest.raises(BadInput, match=r"a\.urdf"):
        require_sound(tmp_path / "inside" / "a.urdf")


def test_what_is_sound_has_no_fault(tmp_path: Path) -> None:
    assert kinds(tmp_path, robot("", joint())) == set()
    assert kinds(tmp_path, hinges(j="k")) == set()


def test_a_link_out_of_the_folder_by_symbolic_link_is_found(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.obj").write_text("v 0 0 0\n")
    (folder / "m.obj").symlink_to(tmp_path / "secret.obj")
    assert kinds(folder, f'<robot name="r"><link name="a">{INERTIA}{mesh("m.obj")}</link></robot>') == {"mesh_outside"}


def test_a_missing_file_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="none.urdf"):
        parse_urdf(tmp_path / "none.urdf")


@pytest.mark.parametrize("shape", ["chain", "star", "circle"])
def test_five_thousand_links(tmp_path: Path, shape: str) -> None:
    """Checked in time that grows with the number of links, without running out of stack."""
    count = 5000
    text = ['<robot name="r"><link name="l0"/>'] + [LINK % f"l{k}" for k in range(1, count)]
    for k in range(1, count):
        text.append(joint("", "fixed", f"j{k}", "l0" if shape == "star" else f"l{k - 1}", f"l{k}"))
    if shape == "circle":
        text.append(joint("", "fixed", "back", f"l{count - 1}", "l1"))
    started = time.process_time()
    found = kinds(tmp_path, "".join(text) + "</robot>")
    assert time.process_time() - started < 10
    assert found == ({"cycle"} if shape == "circle" else set())


LAUGHS = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
    f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9)
)
DOCUMENTS = {
    "billion laughs": f'{LAUGHS}]><robot name="&j;"/>'.encode(),
    "external entity": b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="r"><link name="a">&x;</link></robot>',  # noqa: E501
    "external type": b'<!DOCTYPE robot SYSTEM "http://example.org/x.dtd"><robot name="r"/>',
    "parameter entity": b'<!DOCTYPE r [<!ENTITY % p SYSTEM "file:///etc/passwd"> %p;]><robot name="r"/>',
    "UTF-16": ('<?xml version="1.0" encoding="utf-16"?>' + LAUGHS + ']><robot name="&j;"/>').encode("utf-16"),
    "another encoding": b'<?xml version="1.0" encoding="cp037"?>' + (LAUGHS + ']><robot name="&j;"/>').encode("cp037"),
    "unknown encoding": b'<?xml version="1.0" encoding="nonsense"?><robot name="r"/>',
    "wide encoding": b'<?xml version="1.0" encoding="utf-32"?><robot name="r"/>',
    "deep": b"<robot>" + b"<a>" * 100_000 + b"</a>" * 100_000 + b"</robot>",
    "zero bytes": b'<robot name="r\0"/>',
    "two roots": b"<robot/><robot/>",
    "bad UTF-8": b'<robot name="\xff\xfe"/>',
}


@pytest.mark.parametrize("case", DOCUMENTS)
def test_documents_that_are_refused(tmp_path: Path, case: str) -> None:
    path = tmp_path / "a.urdf"
    path.write_bytes(DOCUMENTS[case])
    started = time.process_time()
    for read in (parse_urdf, read_urdf, require_sound):
        with pytest.raises(BadInput, match=r"a\.urdf") as caught:
            read(path)
        assert "\n" not in str(caught.value)
    assert kinds(tmp_path, DOCUMENTS[case]) == {"unreadable"}
    assert time.process_time() - started < 3


def test_other_encodings_without_entities_are_fine() -> None:
    text = '<?xml version="1.0" encoding="{0}"?><robot name="t\u00fcr"/>'
    for encoding in ("utf-8", "utf-16", "iso-8859-1"):
        assert parse_xml(text.format(encoding).encode(encoding), "x").get("name") == "t\u00fcr"


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("v 0 0 0\n", "holds no triangles"),
        ("", "holds no triangles"),
        (TRIANGLE.replace("v 1", "v nan"), "not finite"),
        (TRIANGLE.replace("v 1", "v 1e30"), "reaches 1e"),
        (TRIANGLE.replace("2 3", "2 9"), ""),
        (TRIANGLE.replace("1", "0", 2).replace("f 0", "f 1"), "is a single point"),
    ],
)
def test_meshes_that_engines_crash_on(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "m.obj").write_text(content)
    path = tmp_path / "a.urdf"
    shape = '<collision><geometry><mesh filename="m.obj"/></geometry></collision>'
    path.write_text(f'<robot name="r"><link name="a">{INERTIA}{shape}</link></robot>')
    assert kinds(tmp_path, path.read_text()) == {"mesh_unreadable"}
    with pytest.raises(BadInput, match=f"m.obj.*{said}"):
        require_sound(path)


@pytest.mark.parametrize("name", ["a" * 5000 + ".obj", "a\tb.obj", "\u53f0.obj", "a b.obj", "file:///etc/passwd", "."])
def test_odd_mesh_names(tmp_path: Path, name: str) -> None:
    text = f'<robot name="r"><link name="a">{INERTIA}{mesh(name)}</link></robot>'
    assert kinds(tmp_path, text) <= {"mesh_outside", "mesh_missing"} != set()
    if name in ("\u53f0.obj", "a b.obj"):
        (tmp_path / name).write_text(TRIANGLE)
        assert kinds(tmp_path, text) == set()


def test_case_collision_is_two_files(tmp_path: Path) -> None:
    """Names that differ in case alone are different here; a URDF that means one of them finds that one."""
    (tmp_path / "M.obj").write_text(TRIANGLE)
    assert kinds(tmp_path, f'<robot name="r"><link name="a">{INERTIA}{mesh("m.obj")}</link></robot>') == {
        "mesh_missing"
    }


def body(name: str, parent: str | None) -> BundleBody:
    return BundleBody(name, "box", parent, "supports", np.eye(4), False, box_from_bounds((0, 0, 0), (1, 1, 1)))


@pytest.mark.parametrize("name", ["..", ".", "../up", "/etc/x", "a b", "", "-x", "world", "a\nb", "a/b"])
def test_bodies_named_like_paths(tmp_path: Path, name: str) -> None:
    from scenewright.schemas.contact_graph import ContactGraphFile

    (tmp_path / "scene").mkdir()
    with pytest.raises(BadInput, match="not usable in URDF"):
        write_scene_bundle(tmp_path / "scene", [body(name, None)], ContactGraphFile(nodes=(), links=()))
    assert list((tmp_path / "scene").iterdir()) == []


def test_a_tower_of_two_thousand_bodies_and_a_circle_of_as_many(tmp_path: Path) -> None:
    from scenewright.stages.kit.formats.scene_bundle import _parents_first

    tower = [body(f"b{k}", f"b{k + 1}" if k < 1999 else None) for k in range(2000)]
    assert [b.name for b in _parents_first(tower)] == [f"b{k}" for k in reversed(range(2000))]
    with pytest.raises(BadInput, match="in a circle"):
        _parents_first([body(f"b{k}", f"b{(k + 1) % 2000}") for k in range(2000)])


@pytest.mark.parametrize("corners", [1, 2, 3])
def test_boxes_around_points_and_lines(corners: int) -> None:
    vertices = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 5.0], [1.0, 4.0, 3.0]])[:corners]
    link_from_box, half = ConvexPiece(vertices).box
    assert np.allclose(link_from_box[:3, 3], (vertices.min(axis=0) + vertices.max(axis=0)) / 2)
    assert np.allclose(np.sort(half), np.sort(np.ptp(vertices, axis=0) / 2))
