"""`library add` and files that grow while they are read, or hold numbers that no geometry library takes.

Each case is small here, and is refused or left out before it becomes large; the model is named in one line.
"""

from __future__ import annotations

import base64
import json
import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_library import ImportFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Joint
from scenewright.stages.kit.formats import mesh_files
from scenewright.stages.kit.formats.xml_files import parse_xml
from scenewright.stages.kit.geometry.solids import box
from scenewright.stages.library.importing import (
    collada_file,
    gltf_reading,
    limits,
    mesh_reading,
    mjcf_document,
    obj_reading,
    pictures,
    pieces,
)
from scenewright.stages.library.importing.assembly import MOST_SECTIONS_CLOSED, _unique_names
from scenewright.stages.library.importing.discovery import find_models
from scenewright.stages.library.importing.mapping import read_mapping
from scenewright.stages.library.importing.mesh_reading import read_mesh_file
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel, Surface, painted_faces
from scenewright.stages.library.surfaces import Sections, surface_planes

from tests.bad_input.payload_bytes import glb
from tests.unit.library.test_addition import add, obj_box, write

CUBE = str(trimesh.creation.box((0.4, 0.4, 0.8)).export(file_type="obj"))
BOX = '<geometry><box size="1 1 1"/></geometry>'
MESHES = '<visual><geometry><mesh filename="meshes/m.obj"/></geometry></visual>'


def mjcf(body: str, before: str = "") -> str:
    return f'<mujoco>{before}<worldbody><body name="chair">{body}</body></worldbody></mujoco>'


def urdf(visual: str, collision: str = "", rest: str = "") -> str:
    hull = f"<collision>{collision}</collision>" if collision else ""
    return f'<robot name="r"><link name="a"><visual>{visual}</visual>{hull}</link>{rest}</robot>'


def collada(nodes: str, library: str = "", triangles: str = "") -> str:
    points = "0 0 0 1 0 0 0 1 0 0 0 1"
    one = '<triangles><input semantic="VERTEX" source="#s" offset="0"/><p>0 1 2 0 1 3 1 2 3 0 2 3</p></triangles>'
    return (
        f'<COLLADA><library_geometries><geometry id="g"><mesh><source id="s"><float_array>{points}</float_array>'
        f"</source>{triangles or one}</mesh></geometry></library_geometries><library_nodes>{library}</library_nodes>"
        f"<library_visual_scenes><visual_scene>{nodes}</visual_scene></library_visual_scenes></COLLADA>"
    )


def lengthened(data: bytes, more: bytes) -> bytes:
    """Return a GLB with more bytes, and a header that says so."""
    return data[:8] + struct.pack("<I", len(data) + len(more)) + data[12:] + more


INSTANCE = '<instance_geometry url="#g"/>'
LADDER = "".join(f'<node id="n{k}">{f"<instance_node url={chr(34)}#n{k + 1}{chr(34)}/>" * 2}</node>' for k in range(14))
BUFFERED = {"buffers": [{"uri": "data:;base64,AAAA", "byteLength": 3}], "accessors": [], "meshes": []}


def meshed(name: str) -> str:
    return urdf(f'<geometry><mesh filename="{name}"/></geometry>')


ENTITIES = '<!DOCTYPE a [<!ENTITY x "y"><!ENTITY z "&x;&x;&x;">]><robot name="a"><link name="&z;"/></robot>'
TWO_PARENTS = (
    '<robot><link name="a"/><link name="b"/><link name="c"/><joint name="j" type="fixed"><parent link="b"/>'
    '<child link="c"/></joint><joint name="k" type="fixed"><parent link="c"/><child link="b"/></joint></robot>'
)
REFUSED: dict[str, tuple[dict[str, str | bytes], str]] = {
    "entities": ({"chair.urdf": ENTITIES}, "document type or entities"),
    "torn": ({"chair.urdf": "<robot"}, "well-formed"),
    "a mesh of the system": ({"chair.urdf": meshed("/etc/passwd")}, "is not in the folder"),
    "a mesh above": ({"chair.urdf": meshed("../secret.obj"), "../secret.obj": CUBE}, "is not in the folder"),
    "a size that is not a number": ({"chair.urdf": urdf(BOX.replace("1 1 1", "1 nan 1"))}, "is not finite"),
    "two roots": ({"chair.urdf": '<robot><link name="a"/><link name="b"/></robot>'}, "2 root links"),
    "links in a circle": ({"chair.urdf": TWO_PARENTS}, "circle"),
    "a file that includes itself": (
        {"chair.xml": '<mujoco><include file="chair.xml"/><worldbody/></mujoco>'},
        "in a circle",
    ),
    "a box of no width": ({"chair.xml": mjcf('<geom type="box" size="0 1 1"/>')}, "without size"),
    "no links": ({"chair.sdf": '<sdf><model name="chair"/></sdf>'}, "no links"),
    "a negative unit": ({"chair.dae": "<COLLADA><asset><unit meter='-1'/></asset></COLLADA>"}, "unit of -1"),
    "a corner that is not there": ({"chair.obj": "v 0 0 0\nv 1 0 0\nf 1 2 9\n"}, "element 9 of 2"),
    "words": ({"chair.stl": "no mesh at all"}, "no STL"),
    "a buffer above": (
        {"chair.gltf": '{"buffers": [{"uri": "../secret.bin", "byteLength": 4}]}', "../secret.bin": b"abcd"},
        "is not in the folder",
    ),
    "no model": ({"readme.txt": "nothing"}, "no model files"),
    "euler sequence": (
        {"chair.xml": mjcf('<geom type="box" size="1 1 1" euler="1 2 3"/>', '<compiler eulerseq="XXX"/>')},
        "chair.*eulerseq 'XXX'",
    ),
    "zero quaternion of a mesh": (
        {
            "chair.xml": mjcf(
                '<geom type="mesh" mesh="m"/>', '<asset><mesh name="m" file="meshes/m.obj" refquat="0 0 0 0"/></asset>'
            ),
            "meshes/m.obj": CUBE,
        },
        "chair.*refquat of length 0",
    ),
    "ellipsoid as flat as a sheet": (
        {"chair.xml": mjcf('<geom type="ellipsoid" size="1 1 1e-16"/>')},
        "chair.*a shape has no volume",
    ),
    "includes that multiply": (
        {f"p{k}.xml": "<mujocoinclude>" + f'<include file="p{k + 1}.xml"/>' * 4 + "</mujocoinclude>" for k in range(5)}
        | {"p5.xml": "<mujocoinclude>" + "<geom/>" * 200 + "</mujocoinclude>"}
        | {"chair.xml": mjcf('<include file="p0.xml"/>')},
        "chair.*more than 2000 elements",
    ),
    "includes that nest": (
        {f"p{k}.xml": f'{"<a>" * 150}<include file="p{k + 1}.xml"/>{"</a>" * 150}' for k in range(8)}
        | {"p8.xml": "<a/>", "chair.xml": mjcf('<include file="p0.xml"/>')},
        "chair.*levels",
    ),
    "defaults that multiply": (
        {
            "chair.xml": mjcf(
                "",
                "<default>"
                + "".join(f'<g{k} a="1"/>' for k in range(300))
                + "".join(f'<default class="c{k}"/>' for k in range(1000))
                + "</default>",
            )
        },
        "chair.*default classes",
    ),
    "a mesh named 400 times": (
        {"chair.urdf": urdf(BOX, rest=f'<link name="b">{MESHES * 400}</link>'), "meshes/m.obj": CUBE},
        "chair.*more than 2000 triangles in all",
    ),
    "a body of 2000 boxes": (
        {"chair.urdf": f'<robot><link name="a">{f"<visual>{BOX}</visual>" * 2000}</link></robot>'},
        "chair.*in all",
    ),
    "a collision hull far away": ({"chair.urdf": urdf(BOX, f'<origin xyz="1e16 0 0"/>{BOX}')}, "chair.*far away"),
    "a slide that does not end": (
        {
            "chair.urdf": urdf(
                BOX,
                rest=f'<link name="b"><visual>{BOX}</visual></link><joint name="j" type="prismatic"><parent link="a"/>'
                '<child link="b"/><limit lower="0" upper="1e30"/></joint>',
            )
        },
        "chair: joint 'j' slides by 1e.30 m",
    ),
    "600 parts that move": (
        {
            "chair.urdf": urdf(
                BOX,
                rest="".join(
                    f'<link name="l{k}"><visual>{BOX}</visual></link><joint name="j{k}" type="revolute">'
                    f'<parent link="a"/><child link="l{k}"/><limit lower="0" upper="1"/></joint>'
                    for k in range(600)
                ),
            )
        },
        "chair.*601 moving parts|chair.*in all",
    ),
    "nodes that multiply": (
        {"chair.dae": collada('<node><instance_node url="#n0"/></node>', f'{LADDER}<node id="n14">{INSTANCE}</node>')},
        "chair.*(in all|too many|repeat too much)",
    ),
    "children looked at again and again": (
        {
            "chair.dae": collada(
                '<node><instance_node url="#n0"/></node>', f'{LADDER}<node id="n14">{"<extra/>" * 2000}</node>'
            )
        },
        "chair.*(repeat too much|too many)",
    ),
    "a polygon of 5000 corners": (
        {"chair.obj": f"v 0 0 0\nv 1 0 0\nv 0 1 1\nf {'1 2 3 ' * 5000}\n"},
        "chair.*more than 2000 triangles",
    ),
    "3000 groups": (
        {"chair.obj": "v 0 0 0\nv 1 0 0\nv 0 1 1\n" + "".join(f"g {k}\nf 1 2 3\n" for k in range(3000))},
        "chair.*(groups|triangles)",
    ),
    "a line without end": ({"chair.obj": CUBE + "x" * (obj_reading.LONGEST_LINE + 1)}, "chair.*a line of"),
    "a length that is infinite": (
        {"chair.gltf": json.dumps(BUFFERED).replace("3}", "1e999}")},
        "chair.*not a whole number",
    ),
    "a view that is infinite": (
        {"chair.glb": glb(bufferViews=[{"buffer": 0, "byteLength": 123456}]).replace(b"123456", b"1e999 ")},
        "chair.*not a whole number",
    ),
    "nodes that share children": (
        {"chair.glb": glb(nodes=[{"children": [k + 1, k + 1]} for k in range(16)] + [{"mesh": 0}])},
        "chair.*hangs on two nodes",
    ),
    "nodes in a circle": (
        {"chair.glb": glb(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}])},
        "chair.*in a circle",
    ),
    "nodes in a chain": (
        {"chair.glb": glb(nodes=[{"children": [k + 1]} for k in range(300)] + [{"mesh": 0}])},
        "chair.*nested deeper than 200",
    ),
    "views that overlap": (
        {"chair.glb": lengthened(glb(bufferViews=[{"buffer": 0, "byteLength": 9000}] * 50), bytes(9000))},
        "chair.*times the file",
    ),
    "a mesh shown 3000 times": ({"chair.glb": glb(nodes=[{"mesh": 0}] * 3000)}, "chair.*3000 triangles"),
    "buffers beyond the bound": (
        {
            "chair.gltf": json.dumps(BUFFERED | {"buffers": [{"uri": "b.bin", "byteLength": 4_000_000_000}] * 20}),
            "b.bin": bytes(10_000),
        },
        "chair.*buffers of more than",
    ),
    "a description of a million lists": ({"chair.gltf": "[" + "[]," * 1_000_001 + "[]]"}, "chair.*values"),
    "a declared STL": ({"chair.stl": bytes(80) + struct.pack("<I", 3000) + bytes(150_000)}, "chair.*3000 triangles"),
}


@pytest.fixture
def small_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds of a thousandth: what is beyond them is as it is beyond the real ones."""
    for module in (limits, mesh_reading, obj_reading, gltf_reading):
        monkeypatch.setattr(module, "MOST_TRIANGLES", 2000)
    monkeypatch.setattr(
        limits.Allowance.__init__, "__kwdefaults__", {"triangles": 2000, "vertices": 6000, "shapes": 1000}
    )
    monkeypatch.setattr(collada_file, "MOST_STEPS", 20_000)
    for module in (mesh_reading, obj_reading):
        monkeypatch.setattr(module, "MOST_SHAPES", 1000)
    monkeypatch.setattr(gltf_reading, "LARGEST_FILE", 50_000)
    monkeypatch.setattr(mjcf_document, "MOST_ELEMENTS", 2000)


@pytest.mark.usefixtures("small_bounds")
@pytest.mark.parametrize("fault", REFUSED)
def test_refused_in_one_line_with_the_name_of_the_model(tmp_path: Path, fault: str) -> None:
    files, reason = REFUSED[fault]
    for name, content in files.items():
        path = tmp_path / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(BadInput, match=reason) as caught:
        add(tmp_path / "in", tmp_path / "out")
    assert "\n" not in str(caught.value) and caught.value.exit_code == 3


@pytest.mark.parametrize("shape", ['<box size="1 1 1e-15"/>', '<cylinder radius="1" length="1e-15"/>'])
def test_a_flat_collision_hull_is_thickened(tmp_path: Path, shape: str) -> None:
    write(tmp_path / "in" / "chair.urdf", urdf(BOX, f"<geometry>{shape}</geometry>"))
    (model,) = add(tmp_path / "in", tmp_path / "out").info.models
    assert 0 < model.mass < 1


def test_a_mapping_takes_the_first_that_fits(tmp_path: Path) -> None:
    write(tmp_path / "map.toml", '[models]\n"*_1" = "table"\n"a_1" = "chair"\n"b" = "sofa"\n"b*" = "lamp"\n')
    mapping = read_mapping(tmp_path / "map.toml")

    def told(name: str, source: str = "x.obj") -> str:
        return mapping.entry(SourceModel(name, source, "OBJ", ())).class_name

    assert [told("a_1"), told("b"), told("b2"), told("c"), told("c", "b")] == ["table", "sofa", "lamp", "", "sofa"]


@pytest.mark.parametrize("end", ["\r", "\r\n", "\n"])
def test_lines_may_end_in_any_way(tmp_path: Path, end: str) -> None:
    write(tmp_path / "in/models/a.obj", "")
    (tmp_path / "in/models/a.obj").write_bytes(CUBE.replace("\n", end).encode())
    table = f"fullId,category,up,front,unit{end}" + f'wss.a,"Chair",,,{end}' * 500
    (tmp_path / "in/metadata.csv").write_bytes(table.encode())
    library = add(tmp_path / "in", tmp_path / "out")
    (record,) = ImportFile.read(library.path("imports.json")).models  # rows that repeat are one model
    assert record.class_name == "chair" and record.format == "ShapeNetSem"


def test_a_table_with_a_cell_of_200000_letters_is_none(tmp_path: Path) -> None:
    obj_box(tmp_path / "in/models/chair.obj", (0.5, 0.5, 1))
    write(tmp_path / "in/metadata.csv", f'fullId,category,up,front,unit,"{"x" * 200_000}"\nwss.chair,Chair,,,\n')
    assert len(add(tmp_path / "in", tmp_path / "out").info.models) == 1


def test_names_that_are_no_text(tmp_path: Path) -> None:
    obj_box(tmp_path / "in/\x1b[31mshelf/chair.obj", (0.5, 0.5, 1))
    (tmp_path / "in").joinpath(os.fsdecode(b"chair\xff.obj")).write_text(CUBE)
    write(tmp_path / "in/table/mobility.urdf", urdf(BOX))
    write(tmp_path / "in/table/meta.json", '{"model_cat": "Table \\ud800"}')
    library = add(tmp_path / "in", tmp_path / "out")
    records = ImportFile.read(library.path("imports.json")).models
    assert len(library.info.models) == 2 and "not UTF-8" in records[0].findings[0]
    assert all(text.isprintable() for record in records for text in (record.name, record.source, *record.findings))


def test_links_and_devices_in_a_library_are_not_copied(tmp_path: Path) -> None:
    obj_box(tmp_path / "in/chair.obj", (0.5, 0.5, 1))
    library = add(tmp_path / "in", tmp_path / "first")
    (library.path("models") / library.info.models[0].id / "more").symlink_to("/dev/zero")
    with pytest.raises(BadInput, match="a link or a device"):
        add(tmp_path / "in", tmp_path / "second", library)


def test_a_mesh_is_read_once_however_often_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    obj_box(tmp_path / "in/meshes/m.obj", (0.5, 0.5, 1))
    write(tmp_path / "in/chair.urdf", f'<robot><link name="a">{MESHES * 30}</link></robot>')
    read: list[Path] = []
    original = SourceFolder.read

    def counted(self: SourceFolder, path: Path, *rest: int) -> bytes:
        read.append(path)
        return original(self, path, *rest)

    monkeypatch.setattr(SourceFolder, "read", counted)
    (model,) = find_models(SourceFolder(tmp_path / "in"))
    assert isinstance(model, SourceModel) and len(model.links[0].visual) == 30
    assert sum(path.name == "m.obj" for path in read) == 1


def test_models_of_a_description_come_one_by_one(tmp_path: Path) -> None:
    bodies = "".join(
        f'<body name="c{k}"><joint type="ball"/><geom type="box" size="1 1 1"/></body>' for k in range(200)
    )
    write(tmp_path / "in/chair.xml", f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    models = [model for model in find_models(SourceFolder(tmp_path / "in")) if isinstance(model, SourceModel)]
    assert len(models) == 200 and {len(model.findings) for model in models} == {1}  # not those of all before


def test_what_is_said_of_a_model_is_bounded(tmp_path: Path) -> None:
    joints = '<joint type="ball"/>'
    bodies = "".join(f'<body name="b{k}">{joints}<geom type="box" size=".1 .1 .1"/></body>' for k in range(200))
    write(tmp_path / "in/chair.xml", mjcf(f'<geom type="box" size=".3 .3 .5"/>{bodies}'))
    library = add(tmp_path / "in", tmp_path / "out")
    (record,) = ImportFile.read(library.path("imports.json")).models
    assert len(record.findings) == limits.MOST_FINDINGS + 1 and record.findings[-1].startswith("and ")


# ---- work that does not grow with the square -------------------------------------------------------------------------


def solids(count: int, step: float) -> list[Surface]:
    shapes = [box((-1 - k * step, 1 - k * step), (-1, 1 + k * step), (-1, 1)) for k in range(count)]
    return [Surface(s.vertices, s.faces, painted_faces(12, None), "", s) for s in shapes]


def counted_hulls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    calls: list[int] = []
    original = pieces._hull

    def counted(points: np.ndarray) -> object:
        calls.append(len(points))
        return original(points)

    monkeypatch.setattr(pieces, "_hull", counted)
    return calls


def test_hulls_of_many_pieces_are_few(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = counted_hulls(monkeypatch)
    kept, findings = pieces.convex_pieces(solids(1500, 1e-3), decompose=False)
    assert len(kept) == pieces.MOST_PIECES and len(calls) == pieces.MOST_COMPONENTS + pieces.MOST_PIECES
    assert findings[0] == "of 1500 loose pieces the 1000 largest collide"


def test_points_of_a_ball_are_thinned_before_their_hull() -> None:
    random = np.random.default_rng(0)
    points = random.normal(size=(200_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    few = pieces.thinned(points)
    assert len(few) <= pieces.MOST_HULL_POINTS + 6
    np.testing.assert_array_equal(few.min(axis=0), points.min(axis=0))
    np.testing.assert_array_equal(few.max(axis=0), points.max(axis=0))
    directions = random.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert ((points @ directions.T).max(axis=0) - (few @ directions.T).max(axis=0)).max() < 0.002
    assert pieces.thinned(points[:1000]) is not points and len(pieces.thinned(points[:1000])) == 1000


def test_cross_sections_are_counted() -> None:
    stack = [surface.solid for surface in solids(60, 1e-2) if surface.solid is not None]
    with pytest.raises(BadInput, match="chair.*more than 500 cross-sections"):
        surface_planes(stack, sections=Sections(500, "chair"))
    sections = Sections(MOST_SECTIONS_CLOSED, "chair")
    assert surface_planes(stack[:4], sections=sections) == surface_planes(stack[:4]) and 0 < sections.taken < 500


def test_names_of_many_joints() -> None:
    joint = Joint(name="j", type="revolute", part="p", origin=(0, 0, 0), axis=(0, 0, 1), lower=0, upper=1)
    names = [found.name for found in _unique_names([joint, joint.model_copy(update={"name": "j_2"}), joint, joint])]
    assert names == ["j", "j_2", "j_3", "j_4"]


def test_a_material_library_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "m.mtl", "newmtl a\nKd 1 0 0\n")
    many = "".join(f"mtllib {'a/' * 200}{k}.mtl\n" for k in range(500))
    write(tmp_path / "chair.obj", "mtllib m.mtl\n" * 500 + many + CUBE)
    looked: list[str] = []
    original = Path.is_file
    monkeypatch.setattr(Path, "is_file", lambda path: looked.append(path.name) or original(path))
    content = read_mesh_file(SourceFolder(tmp_path), tmp_path / "chair.obj")
    assert len(content.surfaces) == 1 and len(looked) < 1000
    assert any("100 of 501 material files" in finding for finding in content.findings)


def test_pictures_beyond_the_bound_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "MOST_PIXELS", 2500)
    monkeypatch.setattr(pictures, "MOST_HELD", 4000)
    for k in range(4):
        cv2.imwrite(str(tmp_path / f"p{k}.png"), np.zeros((32, 32, 3), np.uint8))
    findings: list[str] = []
    some = pictures.Pictures(SourceFolder(tmp_path), tmp_path / "chair.obj", findings)
    shown = [some.picture(f"p{k}.png") is not None for k in (0, 0, 1, 2, 3)]
    assert shown == [True, True, True, False, False] and "more than 2500 pixels in all" in findings[0]


def test_pictures_in_a_glb_count_each_time_they_would_be_decoded() -> None:
    picture = cv2.imencode(".png", np.zeros((40, 50, 3), np.uint8))[1].tobytes()
    text = {
        "images": [{"bufferView": 2}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}] * 3}],
        "nodes": [{"mesh": 0}] * 5,
    }
    views = [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8}]
    views.append({"buffer": 0, "byteOffset": 44, "byteLength": len(picture)})
    data = lengthened(glb(**text, bufferViews=views), picture)
    assert mesh_files.gltf_pixels(data, "chair") == (1 + 3 * 5) * 40 * 50


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (lambda: b"<a>" + b"<b/>" * 1_000_001 + b"</a>", "elements"),
        (lambda: b"<a " + b" ".join(b'a%d=""' % k for k in range(600_000)) + b"/>", "a tag of more than"),
    ],
)
def test_xml_of_very_many_elements(data: Callable[[], bytes], reason: str) -> None:
    with pytest.raises(BadInput, match=reason):
        parse_xml(data(), "chair")


def test_memory_is_bounded(tmp_path: Path) -> None:
    """Files of 3 to 12 MB that took a third of a gigabyte or more."""
    (tmp_path / "numbers.dae").write_bytes(
        collada(f"<node>{INSTANCE}</node>").replace("0 0 0 1 0 0 0 1 0 0 0 1", "0 " * 3_000_000).encode()
    )
    (tmp_path / "lines.obj").write_bytes(b"v 0 0 0\n" * 1_500_000)
    views = [{"buffer": 0, "byteLength": 2_500_000}] * 200
    (tmp_path / "views.glb").write_bytes(lengthened(glb(bufferViews=views), bytes(2_500_000)))
    embedded = base64.b64encode(bytes(2_500_000)).decode()
    buffers = [{"uri": f"data:;base64,{embedded}", "byteLength": 2**40}]
    (tmp_path / "buffer.gltf").write_text(json.dumps({"buffers": buffers}))
    code = """
import resource, sys
from pathlib import Path
from scenewright.stages.library.importing.discovery import find_models
from scenewright.stages.library.importing.source_folder import SourceFolder
resource.setrlimit(resource.RLIMIT_DATA, (350 << 20, 350 << 20))
for model in find_models(SourceFolder(Path(sys.argv[1]))):
    print(model.source, getattr(model, "reason", "read"))
"""
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[-500:]
    assert len(done.stdout.splitlines()) == 4 and "MemoryError" not in done.stdout
