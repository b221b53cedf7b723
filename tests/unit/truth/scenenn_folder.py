"""A small room written as SceneNN is distributed: frames of a playback, y up and a little off, XML, labelled PLY."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from scenewright.stages.kit.geometry.transforms import look_at

from tests.unit.evaluate.handmade import Thing
from tests.unit.ingest.folder_writers import write_scenenn
from tests.unit.ingest.tiny_room import CAMERA, color_image

SCENE = "011"
ROOM = (
    Thing(5, "floor", (-1.6, -1.4, -0.02), (1.6, 1.6, 0.0), 0),
    Thing(17, "wall", (-1.6, 1.6, 0), (1.6, 1.62, 1.8), 0),
    Thing(18, "wall", (1.6, -1.4, 0), (1.62, 1.6, 1.8), 0),
    Thing(8844, "table", (0.2, 0.6, 0), (1.4, 1.4, 0.75), 5),
    Thing(31, "chair", (-0.8, 0.4, 0), (-0.3, 0.9, 0.9), 5),
    Thing(32, "chair", (-1.4, -0.9, 0), (-0.9, -0.4, 0.9), 5),
    Thing(40, "fridge", (-1.55, 1.0, 0), (-0.95, 1.55, 1.5), 5),
    Thing(77, "cup", (0.7, 0.9, 0.75), (0.8, 1.0, 0.86), 8844),
)
TEXTS = {5: "floor", 17: "wall", 18: "Wall 2", 8844: "desk", 31: "chair", 32: "chair2", 40: "fridge", 77: "cup"}
VOID = {77}
"""Labels that are of none of the ten classes."""


def log_from_world() -> np.ndarray:
    """(4, 4): y up, three degrees off, floor half a metre below the origin."""
    tilt = trimesh.transformations.rotation_matrix(np.radians(3), [0.6, 0, 0.8])
    y_from_z = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    shift = np.eye(4)
    shift[:3, 3] = [1.0, -0.5, 2.0]
    return shift @ tilt @ y_from_z


def recorded(count: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(colour, depth [m], log_from_camera) of `count` frames on an arc that looks at the middle."""
    scene = o3d.t.geometry.RaycastingScene()
    for thing in ROOM:
        mesh = thing.mesh()
        scene.add_triangles(
            o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.faces.astype(np.uint32))
        )
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    frames = []
    for k, angle in enumerate(np.linspace(-1.9, 0.3, count)):
        eye = np.array([1.5 * np.cos(angle) - 0.2, 1.5 * np.sin(angle) - 0.1, 1.6])
        pose = look_at(eye, np.array([0.1, 0.7, 0.3]))
        directions = rays @ pose[:3, :3].T
        origin = np.broadcast_to(eye, directions.shape)
        hit = scene.cast_rays(o3d.core.Tensor(np.concatenate([origin, directions], axis=-1).astype(np.float32)))
        depth = hit["t_hit"].numpy()
        frames.append((color_image(k), np.where(depth < 6, depth, 0).astype(np.float32), log_from_world() @ pose))
    return frames


def annotation(texts: dict[int, str] | None = None) -> str:
    """The XML, in the form of the main release (oriented boxes) with one label of the later files' attributes."""
    rows = [
        f'<label id="{label}" text="{text}" obbox="0 0 0 1 1 1 0 0 0 1" '
        + ('nyu_class="desk" aabbox="0 0 0 1 1 1"' if label == 8844 else "")
        + "/>"
        for label, text in (TEXTS if texts is None else texts).items()
    ]
    rows.append('<label id="99" text="" obbox="0 0 0 0 0 0 0 0 0 1"/>')
    return '<?xml version="1.0" encoding="UTF-8"?>\n<annotation>\n' + "\n".join(rows) + "\n</annotation>\n"


def labelled_mesh(relabel: dict[int, int] | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """vertices (V, 3) in the log's world, faces (F, 3), labels (V,) of the whole room."""
    meshes = [thing.mesh() for thing in ROOM]
    whole = trimesh.util.concatenate(meshes)
    numbers = [(relabel or {}).get(thing.instance, thing.instance) for thing in ROOM]
    labels = np.concatenate([np.full(len(m.vertices), n) for m, n in zip(meshes, numbers, strict=True)])
    vertices = trimesh.transform_points(whole.vertices, log_from_world())
    return vertices, np.asarray(whole.faces), labels


def ply_bytes(vertices: np.ndarray, faces: np.ndarray, labels: np.ndarray, *, text: bool = False) -> bytes:
    """The columns of SceneNN's meshes: position, normal, label, colour."""
    kinds = {
        "x": "float",
        "y": "float",
        "z": "float",
        "nx": "float",
        "ny": "float",
        "nz": "float",
        "label": "uint",
        "red": "uchar",
        "green": "uchar",
        "blue": "uchar",
    }
    types = {"float": "<f4", "uint": "<u4", "uchar": "u1"}
    table = np.zeros(len(vertices), np.dtype([(name, types[kind]) for name, kind in kinds.items()]))
    for k, name in enumerate("xyz"):
        table[name] = vertices[:, k]
    table["label"] = labels
    header = f"ply\nformat {'ascii' if text else 'binary_little_endian'} 1.0\nelement vertex {len(vertices)}\n"
    header += "".join(f"property {kind} {name}\n" for name, kind in kinds.items())
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if text:
        rows = [" ".join(str(value) for value in row) for row in table.tolist()]
        rows += ["3 " + " ".join(str(value) for value in face) for face in faces.tolist()]
        return (header + "\n".join(rows) + "\n").encode()
    rows = np.zeros(len(faces), np.dtype([("count", "u1"), ("indices", "<i4", (3,))]))
    rows["count"], rows["indices"] = 3, faces
    return header.encode() + table.tobytes() + rows.tobytes()


def write_folder(root: Path, frames: int = 12) -> Path:
    """Write the scene as `root`/011/; returns that folder."""
    folder = write_scenenn(root / SCENE, recorded(frames))
    (folder / "231.xml").unlink()
    # The data set's playback tool writes the time of depth as a third number.
    times = [line.split() for line in (folder / "timestamp.txt").read_text().splitlines()]
    (folder / "timestamp.txt").write_text("".join(f"{n} {t} {int(t) + 9000}\n" for n, t in times))
    (folder / f"{SCENE}.xml").write_text(annotation())
    (folder / f"{SCENE}.ply").write_bytes(ply_bytes(*labelled_mesh()))
    return folder
