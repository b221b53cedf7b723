"""Harnesses of artifact payloads: archives, arrays, meshes, URDF, trajectories, JSON and TOML."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import shutil
from pathlib import Path

import numpy as np
import trimesh
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.stages.engine import store
from scenewright.stages.engine.digests import content_digest
from scenewright.stages.engine.pipelines import read_pipeline
from scenewright.stages.engine.reading import check_hashes, open_artifact
from scenewright.stages.engine.verification import verify
from scenewright.stages.kit.configuration import read_config
from scenewright.stages.kit.formats.masks import (
    PanopticReader,
    decode_panoptic_png,
    encode_panoptic_png,
    write_panoptic_zip,
)
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.formats.ply_files import ColoredMesh, read_ply, write_ply
from scenewright.stages.kit.formats.trajectories import (
    number_rows,
    read_matrix,
    read_open3d_log,
    read_tum,
    write_open3d_log,
    write_tum,
)
from scenewright.stages.kit.formats.urdf_check import check_urdf
from scenewright.stages.kit.formats.urdf_file import parse_urdf

from tests.fuzz.harness import Harness, as_file, chosen, refused, scratch

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
PIPELINES = Path(__file__).resolve().parents[2] / "data" / "pipelines"
DOCUMENTS: dict[str, type[Model]] = {
    f"{kind}/{name}": model
    for optional in (False, True)
    for kind in sorted(KINDS)
    if not kind.startswith("test_")
    for name, model in (KINDS[kind].optional_json_files if optional else KINDS[kind].json_files).items()
} | {"manifest.json": Manifest}
"""Kind and file -> the model that reads it."""
MODELS = tuple(DOCUMENTS.values())
MESH = trimesh.creation.box((1.0, 2.0, 3.0))


def _written(name: str, write) -> bytes:  # type: ignore[no-untyped-def]
    path = scratch() / name
    write(path)
    return path.read_bytes()


def panoptic_zip(data: bytes) -> None:
    """Open a zip of masks and read three of its images."""
    with refused(BadInput), PanopticReader(as_file("panoptic.zip", data)) as reader:
        for frame in reader.frame_indices()[:3]:
            with refused(BadInput):
                assert reader.read(frame).ndim == 2


def _panoptic_seeds() -> dict[str, bytes]:
    ids = np.arange(12, dtype=np.int32).reshape(3, 4)
    return {"two frames": _written("a.zip", lambda p: write_panoptic_zip(p, [(0, ids), (1, ids * 70_000)]))}


def panoptic_png(data: bytes) -> None:
    """Decode one image of masks."""
    with refused(BadInput):
        assert decode_panoptic_png(data).dtype == np.int32


def npz(data: bytes) -> None:
    """Read two arrays."""
    with refused(BadInput):
        for array in read_arrays(as_file("arrays.npz", data), "a", "b"):
            assert array.nbytes <= 1032 * (len(data) + 1024)


def _npz_seeds() -> dict[str, bytes]:
    seeds = {}
    for name, save in (("stored", np.savez), ("packed", np.savez_compressed)):
        buffer = io.BytesIO()
        save(buffer, a=np.arange(6, dtype=np.int32).reshape(2, 3), b=np.asfortranarray(np.ones((2, 2))))
        seeds[name] = buffer.getvalue()
    return seeds


def _mesh(suffix: str):  # type: ignore[no-untyped-def]
    def target(data: bytes) -> None:
        with refused(BadInput):
            mesh = read_mesh(as_file(f"mesh.{suffix}", data), may_be_empty=True)
            assert np.isfinite(mesh.vertices).all() and mesh.faces.shape[1] == 3

    return target


def _ply_seeds() -> dict[str, bytes]:
    ascii_text = trimesh.exchange.ply.export_ply(MESH, encoding="ascii")
    return {"ascii": ascii_text, "binary": MESH.export(file_type="ply")}


def our_ply(data: bytes) -> None:
    """The reader of the meshes that write_ply writes."""
    with refused(BadInput):
        read_ply(as_file("ours.ply", data))


def _our_ply_seeds() -> dict[str, bytes]:
    mesh = ColoredMesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.uint8))
    return {"triangle": _written("t.ply", lambda path: write_ply(path, mesh))}


def urdf(data: bytes) -> None:
    """Check a URDF, and parse it."""
    path = as_file("robot.urdf", data)
    check_urdf(path)
    with refused(BadInput):
        parse_urdf(path)


def _urdf_seeds() -> dict[str, bytes]:
    static = (GOLDEN / "v1/interactive_scene/static.urdf").read_text()
    small = """<robot name="r"><link name="a"/><link name="b"><inertial>
<origin xyz="0 0 1" rpy="0 1 0"/><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><origin xyz="1 2 3"/><geometry>
<mesh filename="m.obj" scale="2 2 2"/></geometry><material name="c"><color rgba="1 0 0 1"/></material></visual>
<collision><geometry><box size="1 2 3"/></geometry></collision></link><joint name="j" type="revolute"><parent link="a"/>
<child link="b"/><axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/><dynamics damping="1"/>
<mimic joint="j"/></joint></robot>"""
    return {"small": small.encode(), "scene": static[: static.index("</link>") + 7].encode() + b"</robot>"}


def trajectory(data: bytes) -> None:
    """Every reader of poses as text."""
    path = as_file("trajectory.txt", data)
    for read in (read_tum, read_open3d_log, read_matrix, lambda file: number_rows(file, 7)):
        with refused(BadInput):
            read(path)


def _trajectory_seeds() -> dict[str, bytes]:
    poses = np.tile(np.eye(4), (3, 1, 1))
    return {
        "tum": _written("t", lambda path: write_tum(path, np.arange(3.0), poses)),
        "open3d": _written("l", lambda path: write_open3d_log(path, poses[:2])),
        "matrix": b"1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        "rows": b"1 2 3 0 0 0 1 # comment\n\n",
    }


def manifest(data: bytes) -> None:
    """An artifact whose manifest is garbage: opened, hashed and verified."""
    root = scratch() / "artifact"
    root.mkdir(exist_ok=True)
    (root / "graph.json").write_bytes(b"{}")
    (root / MANIFEST_NAME).write_bytes(data)
    with refused(BadInput):
        artifact = open_artifact(root)
        assert artifact.manifest is not None
        check_hashes(root, artifact.manifest)
    with contextlib.suppress(BadInput):
        verify(root)
    with contextlib.suppress(UsageError):
        store.check_target(root, "contact_graph")


def _manifest_seeds() -> dict[str, bytes]:
    whole = Manifest.read(GOLDEN / "v1/contact_graph" / MANIFEST_NAME)
    files = (whole.files[0].model_copy(update={"bytes": 2, "sha256": hashlib.sha256(b"{}").hexdigest()}),)
    update = {"parameters": {}, "libraries": {}, "files": files, "content_digest": content_digest(files)}
    small = whole.model_copy(update=update)
    return {"contact graph": small.model_dump_json().encode()}


def json_payload(data: bytes) -> None:
    """The first byte chooses which payload model reads the rest."""
    number, rest = chosen(data, len(MODELS))
    with refused(BadInput):
        MODELS[number].read(as_file("payload.json", rest))


@functools.cache
def golden_documents() -> dict[str, str]:
    """Return name -> text of a golden document for each of DOCUMENTS that has one, with lists cut where they may be."""
    found = {}
    for name, model in DOCUMENTS.items():
        place = "contact_graph/manifest.json" if model is Manifest else name
        for path in sorted(GOLDEN.glob(f"v*/{place}"), reverse=True):
            document = json.loads(path.read_text())
            texts = (_shortened(document, most) for most in (1, 2, 4, 8, 16))
            text = next((text for text in texts if _is_read(model, text)), "")
            if text:
                found[name] = text
                break
    return found


def _json_seeds() -> dict[str, bytes]:
    numbers = {name: number for number, name in enumerate(DOCUMENTS)}
    return {
        name.replace("/", " ").removesuffix(".json"): bytes([numbers[name]]) + text.encode()
        for name, text in golden_documents().items()
    }


def _is_read(model: type[Model], text: str) -> bool:
    try:
        model.read(as_file("seed.json", text.encode()))
    except BadInput:
        return False
    return True


def _shortened(value: object, most: int) -> str:
    """Return a document as JSON with lists of objects cut to so many entries."""

    def cut(item: object) -> object:
        if isinstance(item, dict):
            return {key: cut(entry) for key, entry in item.items()}
        if isinstance(item, list) and item and isinstance(item[0], dict):
            return [cut(entry) for entry in item[:most]]
        if isinstance(item, list):
            return [cut(entry) for entry in item]
        return item

    return json.dumps(cut(value), separators=(",", ":"))


def settings(data: bytes) -> None:
    """TOML of pipelines and config files."""
    path = as_file("settings.toml", data)
    for read in (read_pipeline, read_config):
        with refused(UsageError):
            read(path)


def _settings_seeds() -> dict[str, bytes]:
    pipeline = b"""name = "p"
summary = "s"
[variables.log]
description = "a log"
[[step]]
name = "sequence"
stage = "ingest"
inputs = { log = "$log" }
parameters = { every = 2 }
seed = 1
"""
    return {"pipeline": pipeline, "config": b"every = 2\nstart = 1.5\ngravity = 'none'\n"}


def journal(data: bytes) -> None:
    """A replacement that was interrupted, with any bytes as its journal."""
    folder = scratch() / "journalled"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "a").mkdir(parents=True)
    (folder / "a" / "kept").write_bytes(b"x")
    (folder / ".a.journal").write_bytes(data)
    store.complete_interrupted(folder / "a")
    assert (folder / "a" / "kept").exists() and not (folder / ".a.journal").exists()


HARNESSES = {
    "panoptic_zip": Harness(panoptic_zip, _panoptic_seeds),
    "panoptic_png": Harness(
        panoptic_png, lambda: {"twelve": encode_panoptic_png(np.arange(12, dtype=np.int32).reshape(3, 4))}
    ),
    "npz": Harness(npz, _npz_seeds),
    "ply": Harness(_mesh("ply"), _ply_seeds),
    "our_ply": Harness(our_ply, _our_ply_seeds),
    "obj": Harness(_mesh("obj"), lambda: {"box": trimesh.exchange.obj.export_obj(MESH).encode()}),
    "stl": Harness(
        _mesh("stl"),
        lambda: {"binary": MESH.export(file_type="stl"), "ascii": MESH.export(file_type="stl_ascii").encode()},
    ),
    "glb": Harness(_mesh("glb"), lambda: {"box": trimesh.Scene(MESH).export(file_type="glb")}),
    "urdf": Harness(urdf, _urdf_seeds),
    "trajectory": Harness(trajectory, _trajectory_seeds),
    "manifest": Harness(manifest, _manifest_seeds),
    "json_payload": Harness(json_payload, _json_seeds, choosing=1),
    "settings": Harness(settings, _settings_seeds),
    "journal": Harness(journal, lambda: {"plan": b'{"partial": ".a.partial-1-00000000", "old": ".a.old-00000000"}'}),
}
