"""Edits of payload files by meaning. Each takes the path of a file and JSON arguments; one that does not fit is passed
over, so that any of a list of edits can be left out."""

from __future__ import annotations

import copy
import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
MOST_COPIES = 10_000


def _document(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _write(path: Path, document: Any) -> None:
    path.write_bytes(json.dumps(document).encode("ascii"))


def _holder(document: Any, place: list[Any]) -> Any:
    for part in place[:-1]:
        document = document[part]
    document[place[-1]]  # noqa: B018 (raises where it is not)
    return document


def put(path: Path, place: list[Any], value: Any) -> None:
    """Put a value at a place of a JSON document."""
    document = _document(path)
    _holder(document, place)[place[-1]] = value
    _write(path, document)


def delete(path: Path, place: list[Any]) -> None:
    """Take a value out of a JSON document."""
    document = _document(path)
    del _holder(document, place)[place[-1]]
    _write(path, document)


def add(path: Path, place: list[Any], name: str, value: Any) -> None:
    """Add an entry to a table of a JSON document, or an item to a list."""
    document = _document(path)
    holder = _holder(document, place)[place[-1]] if place else document
    if isinstance(holder, list):
        holder.append(value)
    else:
        holder[name] = value
    _write(path, document)


def times(path: Path, place: list[Any], count: int) -> None:
    """Repeat a list of a JSON document."""
    document = _document(path)
    holder = _holder(document, place)
    holder[place[-1]] = holder[place[-1]] * min(count, MOST_COPIES)
    _write(path, document)


def _items(document: Any) -> list[list[Any]]:
    """Return every list of tables in a document."""
    found, waiting = [], [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            found.append(value)
        if isinstance(value, dict | list):
            waiting += value.values() if isinstance(value, dict) else value
    return found


def clone(path: Path, key: str, name: Any, count: int) -> None:
    """In all documents beside `path`, repeat every entry that names `name` directly, under new names.

    Ten thousand things of a scene, each consistent with what is said of it elsewhere.
    """
    for file in sorted(path.parent.glob("*.json")):
        if file.name == "manifest.json":
            continue
        document = _document(file)
        for items in _items(document):
            for item in [item for item in items if name in [v for v in item.values() if isinstance(v, str | int)]]:
                if isinstance(name, int) and item.get(key) != name:
                    continue
                for number in range(min(count, MOST_COPIES)):
                    new = f"{name}_{number}" if isinstance(name, str) else 100_000 + number
                    renamed = {k: new if v == name and not isinstance(v, bool) else v for k, v in item.items()}
                    items.append(renamed)
        _write(file, document)


def rename(path: Path, before: str, after: str) -> None:
    """Rename something in every text file of the folder."""
    for file in sorted(path.parent.rglob("*")):
        if file.suffix == ".json" and file.name != "manifest.json":
            _write(file, _renamed(_document(file), before, after))
        elif file.suffix in (".urdf", ".xml", ".srdf", ".txt", ".pddl"):
            text = file.read_bytes()
            file.write_bytes(text.replace(before.encode(), after.encode("utf-8", "surrogatepass")))


def _renamed(value: Any, before: str, after: str) -> Any:
    if isinstance(value, dict):
        return {after if k == before else k: _renamed(v, before, after) for k, v in value.items()}
    if isinstance(value, list):
        return [_renamed(item, before, after) for item in value]
    return after if value == before else value


def array(path: Path, name: str, what: str, value: Any = 0, index: int = 0) -> None:
    """Change an array of an NPZ or NPY file."""
    if path.suffix == ".npy":
        np.save(path, _changed(np.load(path, allow_pickle=False), what, value, index))
        return
    with np.load(path, allow_pickle=False) as archive:
        arrays = dict(archive)
    if what == "gone":
        del arrays[name]
    else:
        arrays[name] = _changed(arrays[name], what, value, index)
    data = io.BytesIO()
    np.savez_compressed(data, **arrays)
    path.write_bytes(data.getvalue())


def _changed(values: np.ndarray, what: str, value: Any, index: int) -> np.ndarray:
    values = values.copy()
    with np.errstate(all="ignore"):
        if what in ("all", "one", "some"):
            flat = values.reshape(-1)
            where = {"all": slice(None), "one": slice(index % max(len(flat), 1), index % max(len(flat), 1) + 1)}
            limits = np.iinfo(values.dtype) if values.dtype.kind in "iu" else None
            if limits is not None:
                value = int(np.clip(np.nan_to_num(float(value)), limits.min, limits.max))
            flat[where.get(what, slice(index % 7, None, 7))] = value
            return flat.reshape(values.shape)
        if what == "kind":
            return values.astype(("f8", "f4", "f2", "i8", "i4", "u1", "?", "u8", "U8", "c16")[index % 10])
    if what == "transposed":
        return values.T
    if what == "flat":
        return values.reshape(-1)
    if what == "deep":
        return values[None]
    rows = {"none": values[:0], "half": values[: len(values) // 2], "first": values[:1]}
    rows |= {"twice": np.concatenate([values, values]), "backwards": values[::-1], "square": values[..., :1]}
    return rows[what]


def number(path: Path, index: int, text: str) -> None:
    """Put another number in the place of the `index`-th of a text file."""
    data = path.read_bytes()
    found = list(NUMBER.finditer(data))
    if found:
        match = found[index % len(found)]
        path.write_bytes(data[: match.start()] + text.encode() + data[match.end() :])


def line(path: Path, index: int, what: str) -> None:
    """Leave a line of a text file out, repeat it, or put it elsewhere."""
    lines = path.read_bytes().splitlines(keepends=True)
    if lines:
        place = index % len(lines)
        taken = lines.pop(place)
        if what == "repeat":
            lines[place:place] = [taken] * 2
        elif what == "first":
            lines.insert(0, taken)
        elif what == "many":
            lines[place:place] = [taken] * MOST_COPIES
        path.write_bytes(b"".join(lines))


def attribute(path: Path, index: int, text: str) -> None:
    """Put other text between the `index`-th pair of quotation marks (XML, PDDL, TOML)."""
    data = path.read_bytes()
    found = list(re.finditer(rb'"([^"\n]*)"', data))
    if found:
        match = found[index % len(found)]
        path.write_bytes(data[: match.start(1)] + text.encode("utf-8", "surrogatepass") + data[match.end(1) :])


def cut(path: Path, share: float) -> None:
    """Keep the first share of a file."""
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


def flip(path: Path, place: int, value: int) -> None:
    """Change a byte."""
    data = bytearray(path.read_bytes())
    if data:
        data[place % len(data)] = value
        path.write_bytes(data)


def remove(path: Path) -> None:
    """Take the file away."""
    path.unlink()


def content(path: Path, text: str) -> None:
    """Let the file hold this text; it need not have been there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))


def swap(path: Path, other: str) -> None:
    """Let two files of the artifact change places."""
    second = path.parent / other if (path.parent / other).exists() else path.parents[other.count("/")] / other
    first = path.read_bytes()
    path.write_bytes(second.read_bytes())
    second.write_bytes(first)


def mesh(path: Path, what: str, value: float = 0.0) -> None:
    """Change the shape in a mesh file."""
    import trimesh
    from scenewright.stages.kit.formats.ply_files import ColoredMesh, read_ply, write_ply

    ours = path.suffix == ".ply" and b"uchar red" in path.read_bytes()[:400]
    if ours:
        found = read_ply(path)
        vertices, faces = found.vertices, found.faces
    else:
        loaded = trimesh.load(path, process=False, force="mesh")
        vertices, faces = np.asarray(loaded.vertices, np.float32), np.asarray(loaded.faces)
    vertices, faces = _changed_shape(vertices.copy(), faces.copy(), what, value)
    if ours:
        colors = (
            np.resize(found.colors, (len(vertices), 3)) if len(found.colors) else np.zeros((len(vertices), 3), "u1")
        )
        write_ply(path, ColoredMesh(vertices, faces, colors.astype("u1")))
    else:
        path.write_bytes(_exported(trimesh.Trimesh(vertices, faces, process=False), path.suffix[1:]))


def _exported(shape: Any, kind: str) -> bytes:
    data = shape.export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)


def _changed_shape(vertices: np.ndarray, faces: np.ndarray, what: str, value: float) -> tuple[np.ndarray, np.ndarray]:
    nothing = np.zeros((0, 3), faces.dtype)
    with np.errstate(all="ignore"):
        if what == "empty":
            return vertices[:0], nothing
        if what == "points":
            return vertices, nothing
        if what == "one":
            return vertices[:3], np.array([[0, 1, 2]], faces.dtype)
        if what == "same":
            vertices[:] = vertices[:1]
        elif what == "flat":
            vertices[:, int(value) % 3] = 0
        elif what == "line":
            vertices[:, :2] = 0
        elif what == "put":
            vertices[:: max(len(vertices) // 3, 1)] = value
        elif what == "scale":
            vertices = vertices * np.float32(value)
        elif what == "shift":
            vertices = vertices + np.float32(value)
        elif what == "many":
            times = min(200_000 // max(len(faces), 1), 1000)
            copies = [faces + k * len(vertices) for k in range(times)]
            vertices = np.concatenate([vertices + 0.01 * k for k in range(times)]) if times else vertices
            faces = np.concatenate(copies) if copies else faces
        elif what == "inside_out":
            faces = faces[:, ::-1]
        elif what == "twice":
            faces = np.concatenate([faces, faces])
    return vertices, faces


def picture(path: Path, what: str) -> None:
    """Let a picture show something else, in another size or format."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    height, width = image.shape[:2]
    made = {
        "black": np.zeros_like(image),
        "white": np.full_like(image, np.iinfo(image.dtype).max),
        "noise": np.random.default_rng(0).integers(0, 255, image.shape).astype(image.dtype),
        "dot": image[:1, :1],
        "row": image[:1],
        "half": image[: height // 2],
        "turned": np.rot90(image).copy(),
        "gray": image[..., 0].copy() if image.ndim == 3 else np.dstack([image] * 3),
        "deep": (image.astype(np.uint16) * 257) if image.dtype == np.uint8 else (image >> 8).astype(np.uint8),
        "large": np.zeros((4 * height, 4 * width, *image.shape[2:]), image.dtype),
    }[what]
    path.write_bytes(cv2.imencode(path.suffix, made)[1].tobytes())


def frames(path: Path, what: str, value: float = 0.0) -> None:
    """Change the frames of a sequence, in the file format of ours."""
    from scenewright.schemas.scene_parts import Camera
    from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter

    with FrameReader(path) as reader:
        read, baselines = list(reader.frames(("color", "depth", "labels", "right"))), reader.baselines
        cameras, labels = dict(reader.cameras), "labels" in reader.streams
    name = next(iter(cameras))
    camera = cameras[name]
    if what == "focal":
        camera = camera.model_copy(update={"fx": value, "fy": value})
    elif what == "center":
        camera = camera.model_copy(update={"cx": value})
    elif what == "small":
        camera = Camera(width=1, height=1, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    cameras[name] = camera
    read = {"none": [], "one": read[:1]}.get(what, read)
    with FrameWriter(path, camera, labels=labels, cameras=cameras, baselines=baselines) as writer:
        for k, frame in enumerate(read):
            pose, color, depth, mask, right = (
                frame.world_from_camera,
                frame.color,
                frame.depth,
                frame.labels,
                frame.right,
            )
            if what == "far" and pose is not None:
                pose = pose.copy()
                pose[:3, 3] = value
            elif what == "poses":
                pose = read[0].world_from_camera
            elif what == "no_poses":
                pose = None
            elif what == "no_color":
                color = None
            elif what == "no_depth":
                depth = None
            elif what == "no_labels":
                mask = None
            elif what == "depth" and depth is not None:
                depth = np.full_like(depth, value)
            elif what == "black" and color is not None:
                color = np.zeros_like(color)
            elif what == "labels" and mask is not None:
                mask = np.full(mask.shape, int(value) & 0xFFFF)
            elif what == "noise" and depth is not None:
                depth = np.random.default_rng(k).uniform(0.1, 5.0, depth.shape)
            elif what == "small":
                color, right = (None if image is None else image[:1, :1] for image in (color, right))
                depth, mask = (None if image is None else image[:1, :1] for image in (depth, mask))
            writer.write(frame.time + (value if what == "late" and k else 0), color, depth, pose, mask, right=right)


def masks(path: Path, what: str, value: int = 0) -> None:
    """Change the images of panoptic.zip."""
    from scenewright.stages.kit.formats.masks import PanopticReader, write_panoptic_zip

    with PanopticReader(path) as reader:
        images = [(index, reader.read(index)) for index in reader.frame_indices()]
    if what == "put":
        images = [(index, np.full_like(ids, value & 0xFFFFFF)) for index, ids in images]
    elif what == "none":
        images = []
    elif what == "first":
        images = images[:1]
    elif what == "shift":
        images = [(index + value, ids) for index, ids in images]
    elif what == "small":
        images = [(index, ids[:1, :1]) for index, ids in images]
    elif what == "noise":
        rng = np.random.default_rng(value % 2**32)
        kinds = [np.unique(ids) for _, ids in images]
        images = [(i, rng.choice(k, ids.shape).astype(np.int32)) for (i, ids), k in zip(images, kinds, strict=True)]
    path.unlink()
    write_panoptic_zip(path, images)


EDITS: dict[str, Callable[..., None]] = {
    function.__name__: function
    for function in (put, delete, add, times, clone, rename, array, number, line, attribute, cut, flip, remove, content)
} | {function.__name__: function for function in (swap, mesh, picture, frames, masks)}
MISFITS = (
    *(LookupError, TypeError, ValueError, OSError, AttributeError, OverflowError, NotImplementedError),
    *(zipfile.BadZipFile, cv2.error),
)
"""What an edit raises that does not fit what an earlier one left."""


def apply(how: str, path: Path, arguments: tuple[Any, ...]) -> bool:
    """Apply an edit. Returns whether it fitted."""
    from scenewright.schemas.errors import ScenewrightError

    try:
        EDITS[how](path, *copy.deepcopy(arguments))
    except (*MISFITS, ScenewrightError):
        return False
    return True
