"""What mesh files of strangers hold beside triangles: read with its right value, or told."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.library.importing.mesh_reading import MeshContent, read_mesh_file
from scenewright.stages.library.importing.source_folder import SourceFolder

from tests.bad_input.payload_bytes import glb
from tests.unit.library.test_addition import add, dae, only, size_of, write

COMPONENTS = {"float32": 5126, "uint8": 5121, "uint16": 5123, "int16": 5122, "uint32": 5125}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
FACES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)
GREEN, RED = [0, 200, 0], [200, 0, 0]


class Gltf:
    """A glTF while it is made."""

    def __init__(self) -> None:
        self.binary = b""
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.tree |= {"nodes": [{"mesh": 0}], "accessors": [], "bufferViews": [], "materials": [{}]}

    def view(self, data: bytes) -> int:
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data + b"\0" * (-len(data) % 4)
        return len(self.tree["bufferViews"]) - 1

    def array(self, values: np.ndarray, **more: Any) -> int:
        width = values.shape[1] if values.ndim == 2 else 1
        said = {"componentType": COMPONENTS[str(values.dtype)], "count": len(values), "type": KINDS[width]}
        self.tree["accessors"].append({"bufferView": self.view(values.tobytes()), **said, **more})
        return len(self.tree["accessors"]) - 1

    def square(self, **attributes: int) -> None:
        position = attributes.pop("POSITION", None)
        position = self.array(SQUARE) if position is None else position
        primitive = {"attributes": {"POSITION": position, **attributes}, "indices": self.array(FACES), "material": 0}
        self.tree["meshes"] = [{"primitives": [primitive]}]

    def picture(self, texture: dict[str, Any]) -> None:
        """Paint the material with a picture, green on the left and red on the right."""
        pixels = np.zeros((8, 8, 3), np.uint8)
        pixels[:, :4], pixels[:, 4:] = GREEN[::-1], RED[::-1]
        view = self.view(cv2.imencode(".png", pixels)[1].tobytes())
        self.tree |= {"images": [{"bufferView": view, "mimeType": "image/png"}], "textures": [{"source": 0}]}
        self.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **texture}}}]

    def bytes(self) -> bytes:
        text = json.dumps(self.tree | {"buffers": [{"byteLength": len(self.binary)}]}).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(self.binary), len(text), b"JSON")
        return head + text + struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary


def read(folder: Path, name: str, data: bytes | str) -> MeshContent:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_mesh_file(SourceFolder(folder), path.resolve())


def bounds(content: MeshContent) -> list[list[float]]:
    points = np.concatenate([surface.vertices for surface in content.surfaces])
    return [np.round(points.min(axis=0), 6).tolist(), np.round(points.max(axis=0), 6).tolist()]


def colors(content: MeshContent) -> list[list[int]]:
    return np.unique(np.concatenate([surface.colors for surface in content.surfaces]), axis=0).tolist()


UV = np.array([[0.1, 0.1], [0.4, 0.1], [0.4, 0.9], [0.1, 0.9]], dtype=np.float32)


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({}, GREEN),
        ({"offset": [0.5, 0.0]}, RED),
        ({"offset": [1.0, 0.0], "scale": [-1.0, 1.0]}, RED),
        ({"rotation": np.pi, "offset": [1.0, 1.0]}, RED),  # 1 - u: from 0.6 to 0.9
        ({"texCoord": 1}, RED),
    ],
)
def test_the_texture_transform_of_a_gltf(tmp_path: Path, said: dict[str, Any], expected: list[int]) -> None:
    gltf = Gltf()
    other = np.ascontiguousarray(UV + [0.5, 0.0], dtype=np.float32)
    gltf.square(TEXCOORD_0=gltf.array(UV), TEXCOORD_1=gltf.array(other))
    gltf.picture({"extensions": {"KHR_texture_transform": said}})
    gltf.tree["extensionsRequired"] = gltf.tree["extensionsUsed"] = ["KHR_texture_transform"]
    content = read(tmp_path, "a.glb", gltf.bytes())
    assert colors(content) == [expected] and content.findings == ()


def test_a_quarter_turn_of_a_texture(tmp_path: Path) -> None:
    """KHR_texture_transform: u' = u cos + v sin, v' = v cos - u sin; points of v 0.6 to 0.9 get u 0.6 to 0.9."""
    gltf = Gltf()
    gltf.square(TEXCOORD_0=gltf.array(np.array([[0.1, 0.6], [0.4, 0.6], [0.4, 0.9], [0.1, 0.9]], dtype=np.float32)))
    gltf.picture({"extensions": {"KHR_texture_transform": {"rotation": np.pi / 2, "offset": [0.0, 1.0]}}})
    assert colors(read(tmp_path, "a.glb", gltf.bytes())) == [RED]


def test_second_texture_points(tmp_path: Path) -> None:
    gltf = Gltf()
    other = np.ascontiguousarray(UV + [0.5, 0.0], dtype=np.float32)
    gltf.square(TEXCOORD_0=gltf.array(UV), TEXCOORD_1=gltf.array(other))
    gltf.picture({"texCoord": 1})
    assert colors(read(tmp_path, "a.glb", gltf.bytes())) == [RED]


def test_normalised_texture_points_and_positions(tmp_path: Path) -> None:
    gltf = Gltf()
    points = np.zeros((4, 4), np.int16)
    points[:, :3] = np.round(SQUARE * 32767)
    position = gltf.array(np.ascontiguousarray(points[:, :3]), normalized=True)
    gltf.square(POSITION=position, TEXCOORD_0=gltf.array(np.round(UV * 65535).astype(np.uint16), normalized=True))
    gltf.picture({})
    gltf.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    content = read(tmp_path, "a.glb", gltf.bytes())
    assert bounds(content) == [[0, 0, 0], [1, 1, 0]] and colors(content) == [GREEN]


@pytest.mark.parametrize("based", [True, False])
def test_sparse_arrays(tmp_path: Path, based: bool) -> None:
    gltf = Gltf()
    position = gltf.array(SQUARE)
    said = gltf.tree["accessors"][position]
    said["sparse"] = {
        "count": 2,
        "indices": {"bufferView": gltf.view(np.array([1, 2], np.uint8).tobytes()), "componentType": 5121},
        "values": {"bufferView": gltf.view(np.array([[5, 0, 0], [5, 7, 0]], "<f4").tobytes())},
    }
    if not based:
        del said["bufferView"]
    gltf.square(POSITION=position)
    assert bounds(read(tmp_path, "a.glb", gltf.bytes())) == [[0, 0, 0], [5, 7, 0]]
    with pytest.raises(BadInput, match="sparse"):
        read_mesh(tmp_path / "a.glb")


def test_instances_fans_and_colours_of_vertices(tmp_path: Path) -> None:
    gltf = Gltf()
    red = np.array([[255, 0, 0, 255]] * 4, np.uint8)
    gltf.square(COLOR_0=gltf.array(red, normalized=True))
    primitive = gltf.tree["meshes"][0]["primitives"][0]
    primitive["mode"] = 6
    del primitive["indices"]
    gltf.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}]
    moved = gltf.array(np.array([[0, 0, 0], [3, 0, 0]], dtype=np.float32))
    said = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moved}}}
    gltf.tree["nodes"] = [{"mesh": 0, "extensions": said}]
    gltf.tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    content = read(tmp_path, "a.glb", gltf.bytes())
    assert content.triangles == 4 and bounds(content) == [[0, 0, 0], [4, 1, 0]] and colors(content) == [[255, 0, 0]]


@pytest.mark.parametrize(
    ("extension", "way"),
    [
        ("KHR_draco_mesh_compression", "npx @gltf-transform/cli copy chair.glb OUT.glb"),
        ("EXT_meshopt_compression", "npx @gltf-transform/cli copy chair.glb OUT.glb"),
        ("ACME_bent_space", "export it without ACME_bent_space"),
    ],
)
def test_an_extension_that_is_needed_is_named(tmp_path: Path, extension: str, way: str) -> None:
    compressed = {"extensionsUsed": [extension], "extensionsRequired": [extension]}
    accessor = {"componentType": 5126, "count": 3, "type": "VEC3"}
    for changes in (compressed, compressed | {"accessors": [accessor, accessor]}):
        with pytest.raises(BadInput) as caught:
            read(tmp_path, "chair.glb", glb(**changes))
        assert caught.value.message.endswith(f"needs the extension {extension}, which is not read")
        assert caught.value.hint == way
        with pytest.raises(BadInput, match=f"needs the extension {extension}"):
            read_mesh(tmp_path / "chair.glb")


def test_an_extension_that_is_not_listed_as_needed(tmp_path: Path) -> None:
    accessor = {"componentType": 5126, "count": 3, "type": "VEC3"}
    with pytest.raises(BadInput, match="needs the extension KHR_draco_mesh_compression"):
        read(tmp_path, "a.glb", glb(accessors=[accessor], extensionsUsed=["KHR_draco_mesh_compression"]))
    with pytest.raises(BadInput, match="an array has no data"):
        read(tmp_path, "b.glb", glb(accessors=[accessor]))


def test_pictures_that_are_not_read_leave_the_shape(tmp_path: Path) -> None:
    gltf = Gltf()
    gltf.square(TEXCOORD_0=gltf.array(UV))
    gltf.picture({})
    gltf.tree["images"][0]["mimeType"] = "image/ktx2"
    gltf.tree["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    gltf.tree["extensionsRequired"] = ["KHR_texture_basisu"]
    content = read(tmp_path, "a.glb", gltf.bytes())
    assert content.triangles == 2
    assert "a.glb: images need KHR_texture_basisu" in content.findings[0] and "ktxdecompress" in content.findings[0]


def test_pictures_and_buffers_beside_a_gltf(tmp_path: Path) -> None:
    gltf = Gltf()
    gltf.square(TEXCOORD_0=gltf.array(UV))
    gltf.picture({})
    view = gltf.tree["bufferViews"][gltf.tree["images"][0]["bufferView"]]
    picture = gltf.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    (tmp_path / "dark wood.png").write_bytes(picture)
    (tmp_path / "the data.bin").write_bytes(gltf.binary)
    gltf.tree["images"] = [{"uri": "dark%20wood.png"}]
    buffers = {"buffers": [{"uri": "the%20data.bin", "byteLength": len(gltf.binary)}]}
    for name, data in (("a.gltf", json.dumps(gltf.tree | buffers)), ("a.glb", gltf.bytes())):
        content = read(tmp_path, name, data)
        assert colors(content) == [GREEN] and content.findings == ()
    (tmp_path / "dark wood.png").unlink()
    content = read(tmp_path, "b.gltf", json.dumps(gltf.tree | buffers))
    assert content.triangles == 2
    assert content.findings == (
        "b.gltf: image 'dark%20wood.png' is not in the folder: colours are those of the materials",
    )


def test_skins_and_morph_targets_are_told(tmp_path: Path) -> None:
    gltf = Gltf()
    gltf.square()
    gltf.tree["meshes"][0] |= {"weights": [0.5]}
    gltf.tree["nodes"] = [{"mesh": 0, "skin": 0}]
    findings = read(tmp_path, "a.glb", gltf.bytes()).findings
    assert findings == (
        "a.glb: morph targets are not applied: shapes are those without them",
        "a.glb: skins are not applied: shapes are those before any bone moves them",
    )


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


def test_obj_colours_of_vertices(tmp_path: Path) -> None:
    rows = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    shares = "".join(f"v {x} {y} {z} 1.0 0.0 0.2\n" for x, y, z in rows)
    assert colors(read(tmp_path, "a.obj", shares + "f 1 2 3\n")) == [[255, 0, 51]]
    bytes_ = "".join(f"v {x} {y} {z} 255 0 51\n" for x, y, z in rows)
    assert colors(read(tmp_path, "b.obj", bytes_ + "f 1 2 3\n")) == [[255, 0, 51]]
    assert colors(read(tmp_path, "c.obj", shares + "v 0 0 1\nf 1 2 3\n")) == [[178, 178, 178]]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("map_Kd tex images/dark wood.png", GREEN),
        ("map_Kd tex images\\dark wood.png", GREEN),
        ("map_kd\ttex images/dark wood.png", GREEN),
        ("map_Kd -o 0.5 0 0 tex images/dark wood.png", RED),
        ("map_Kd -s -1 1 -o 1 0 0 -bm 1.0 -clamp on -mm 0 1 tex images/dark wood.png", RED),
        ("map_Kd -blendu on -o 0.5 tex images/dark wood.png", RED),
    ],
)
def test_pictures_of_an_obj(tmp_path: Path, line: str, expected: list[int]) -> None:
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:, :4], pixels[:, 4:] = GREEN[::-1], RED[::-1]
    (tmp_path / "tex images").mkdir()
    (tmp_path / "tex images" / "dark wood.png").write_bytes(cv2.imencode(".png", pixels)[1].tobytes())
    write(tmp_path / "my wood.mtl", f"newmtl dark oak\nKd 1 1 1\n{line}\n")
    mapped = "vt 0.1 0.1\nvt 0.4 0.1\nvt 0.1 0.9\nusemtl dark oak\nf 1/1 2/2 3/3\n"
    content = read(tmp_path, "a.obj", f"mtllib my wood.mtl\n{OBJ}{mapped}")
    assert colors(content) == [expected] and content.findings == ()


def test_several_material_files_on_one_line(tmp_path: Path) -> None:
    write(tmp_path / "a.mtl", "newmtl a\nKd 1 0 0\n")
    write(tmp_path / "b.mtl", "newmtl b\nKd 0 1 0\n")
    content = read(tmp_path, "a.obj", f"mtllib a.mtl b.mtl\n{OBJ}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 4\n")
    assert colors(content) == [[0, 255, 0], [255, 0, 0]] and content.findings == ()
    content = read(tmp_path, "b.obj", f"mtllib gone.mtl\n{OBJ}f 1 2 3\n")
    assert content.findings == ("b.obj: material file 'gone.mtl' is not there",)


def test_lines_of_an_obj_that_go_on_and_tabs(tmp_path: Path) -> None:
    content = read(tmp_path, "a.obj", OBJ.replace(" ", "\t") + "f 1 2 \\\n  3 4\nf -4 -3 -1\n")
    assert content.triangles == 3 and bounds(content) == [[0, 0, 0], [1, 1, 1]]


def test_what_an_obj_holds_beside_triangles_is_told(tmp_path: Path) -> None:
    curved = "cstype bspline\ndeg 3\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nend\ncurv 0 1 1 2 3\nwobble 3\nl 1 2\ns off\n"
    content = read(tmp_path, "a.obj", f"# made here\n{OBJ}vn 0 0 1\nf 1 2 3\n{curved}")
    assert content.findings == (
        "a.obj: free-form surfaces left out (1)",
        "a.obj: free-form curves left out (1)",
        "a.obj: lines of 'wobble' left out (1)",
    )
    with pytest.raises(BadInput, match="holds no triangles .*free-form surfaces left out"):
        read(tmp_path, "b.obj", f"{OBJ}{curved}")


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        (("<translate>", "<lookat>1 0 0 0 0 0 0 1 0</lookat><translate>"), "lookat"),
        (("</node>", '<instance_node url="other.dae#a"/></node>'), "instance_node of another file, or of nothing"),
        (("</node>", '<instance_geometry url="#nothing"/></node>'), "instance_geometry of another file, or of nothing"),
        (("</node>", '<instance_controller url="#c"/></node>'), "skinned geometry"),
        (("</node>", "<turntable/></node>"), "turntable"),
        (("</polylist>", "</polylist><tristrips/>"), "tristrips"),
        (("</polylist>", "</polylist><quads/>"), "quads"),
        (("</polylist>", "</polylist><polygons><ph><p>0 0 0</p><h>0</h></ph></polygons>"), "polygons with holes"),
    ],
)
def test_what_a_dae_holds_beside_triangles_is_told(tmp_path: Path, change: tuple[str, str], finding: str) -> None:
    plain = dae(1.0, "Z_UP", (1, 1, 1)).replace("</node>", "<extra/><instance_light url='#l'/><asset/></node>")
    assert read(tmp_path, "plain.dae", plain).findings == ()
    content = read(tmp_path, "a.dae", plain.replace(*change))
    assert content.triangles == 12 and content.findings == (f"a.dae: left out: {finding}",)


def test_a_chair_lies_down_for_no_convention(tmp_path: Path) -> None:
    boxes = {(0, 0, 0.42): (0.5, 0.5, 0.06), (0, 0.22, 0.7): (0.5, 0.06, 0.5)}
    boxes |= {(x, y, 0.2): (0.05, 0.05, 0.4) for x in (-0.2, 0.2) for y in (-0.2, 0.2)}
    parts = [trimesh.creation.box(size).apply_translation(at) for at, size in boxes.items()]
    standing = trimesh.util.concatenate(parts)
    for name, mesh in (("z", standing), ("y", standing.copy().apply_transform(np.eye(4)[[0, 2, 1, 3]] * [1, 1, 1, 1]))):
        folder = tmp_path / name
        folder.mkdir()
        mesh.export(folder / "chair.obj", include_normals=False)
        model, record = only(add(folder, tmp_path / f"{name}_out"))
        np.testing.assert_allclose(size_of(model), [0.5, 0.5, 0.95], atol=1e-6)
        assert record.up == f"+{name}" and record.front_from == "back rest"


@pytest.mark.parametrize("line", ["v 1 2", "v 1 2 x", "f 1 a 3", "f 1// /2 3", "vt x"])
def test_a_line_that_is_none_of_an_obj_is_named(tmp_path: Path, line: str) -> None:
    with pytest.raises(BadInput, match=f"line 5 is none of an OBJ: {line!r}"):
        read(tmp_path, "a.obj", f"{OBJ}{line}\nf 1 2 3\n")


def test_strips_of_a_ply_are_named(tmp_path: Path) -> None:
    header = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    strips = b"element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    with pytest.raises(BadInput, match="its triangles are strips"):
        read(tmp_path, "a.ply", header + strips)


def test_messages_name_what_is_wrong(tmp_path: Path) -> None:
    """No exception of a library, and no advice that is a phrase."""
    for name, data in {
        "a.ply": b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0\nx\n3 0 1 2\n",
        "a.stl": b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n",
        "a.glb": glb(meshes=[{"primitives": [{"attributes": {"POSITION": 7}}]}]),
        "b.glb": glb(meshes=[{"primitives": [{}]}]),
    }.items():
        with pytest.raises(BadInput) as caught:
            read(tmp_path, name, data)
        assert "export it again" not in str(caught.value) and "Error" not in str(caught.value).replace("IndexError", "")
