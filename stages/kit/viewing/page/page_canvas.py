"""What viewers draw, recorded, and written as one page when they are done."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.schemas.plain_text import cleaned
from scenewright.schemas.scene_parts import Box, Camera
from scenewright.stages.kit.formats.foxglove import PNG_START
from scenewright.stages.kit.geometry.boxes import box_corners
from scenewright.stages.kit.geometry.cells import cell_keys
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.viewing.canvas import Color, JointedLink, Parts, Trust, bytes_of, trust_color, vertex_colors
from scenewright.stages.kit.viewing.page.library import three_js
from scenewright.stages.kit.viewing.page.packing import STEPS, Block, thinned_mesh

FOLDER = Path(__file__).resolve().parent
LARGEST_PAGE = 15_000_000
"""Largest page [bytes]."""
MOST_VERTICES = 240_000
"""Most vertices of all meshes together; more are thinned."""
EDGES = (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.5, 1.0, 5.0)
"""Cubes that hold one vertex, the least that suffice [m]."""
SMALL = 500
"""Vertices of meshes that are never thinned."""
MOST_POINTS = 60_000
"""Most points of a cloud; more are thinned."""
MOST_PICTURE_BYTES = 4_000_000
"""Most bytes of all pictures together; of more, every second one, every third one and so on is kept."""
MARGIN = 0.15
"""Around what is kept in sight where no viewer said what that is, of its size."""


@dataclass
class _Mesh:
    path: str
    time: float | None
    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None
    front_only: bool
    parts: Parts | None


@dataclass(frozen=True)
class ServedPage:
    """What a page has that comes from a server of ours."""

    script: str
    """Ours; it waits for `scenewright-ready` and finds the page at `window.scenewright`."""
    facts: Mapping[str, Any]
    """For the script: JSON."""


class PageCanvas:
    """A page that is written to `save`, if that is given, when nothing went wrong. Raises BadInput when it would be
    too large."""

    def __init__(self, name: str, save: Path | None = None) -> None:
        self._name, self._save = name, save
        self._time: float | None = None
        self._block = Block()
        self._meshes: list[_Mesh] = []
        self._pictures: list[tuple[str, float | None, bytes]] = []
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._entries: dict[str, list[Any]] = {
            kind: [] for kind in ("lines", "points", "boxes", "transforms", "documents", "views", "joints", "moments")
        }
        self._graph: dict[str, Any] | None = None
        self._trust: dict[str, dict[str, Any]] = {}
        self._because: dict[str, list[str]] = {}
        self._left_out: set[str] = set()
        self._pyramids: set[str] = set()

    def __enter__(self) -> PageCanvas:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None and self._save is not None:
            self._write(self._save)

    def time(self, seconds: float, timeline: str = "time") -> None:
        """See Canvas."""
        self._time = float(seconds)

    def always(self) -> None:
        """See Canvas."""
        self._time = None

    def enclose(self, minimum: ArrayLike, maximum: ArrayLike) -> None:
        """See Canvas."""
        self._low = np.minimum(self._low, np.asarray(minimum, dtype=float))
        self._high = np.maximum(self._high, np.asarray(maximum, dtype=float))

    def view(self, name: str, *hidden: str) -> None:
        """See Canvas."""
        self._entries["views"].append({"name": name, "hidden": list(hidden)})

    def mesh(
        self,
        path: str,
        mesh: trimesh.Trimesh,
        colors: np.ndarray | None = None,
        *,
        front_only: bool = False,
        parts: Parts | None = None,
    ) -> None:
        """See Canvas."""
        if len(mesh.faces) == 0:
            return
        mesh, colors = vertex_colors(mesh, colors)
        painted = None if colors is None else np.asarray(colors)[:, :3].astype(np.uint8)
        vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
        if parts is not None and len(parts.ids) != len(vertices):
            parts = None  # faces with a colour each have vertices of their own
        self._meshes.append(_Mesh(path, self._time, vertices, faces, painted, front_only, parts))

    def points(self, path: str, points: np.ndarray, colors: np.ndarray | None = None, radius: float = 0.005) -> None:
        """See Canvas."""
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        every = max(1, -(-len(points) // MOST_POINTS))
        entry = {**self._entry(path), **self._block.positions(points[::every]), "radius": float(radius)}
        if colors is not None and np.asarray(colors).ndim == 2:
            entry["colors"] = self._block.put(np.asarray(colors)[::every, :3].astype(np.uint8))
        self._entries["points"].append(entry)

    def line(
        self,
        path: str,
        strips: list[np.ndarray],
        colors: list[Color],
        radius: float = 0.004,
        labels: list[str] | None = None,
    ) -> None:
        """See Canvas."""
        arrays = [np.asarray(strip, dtype=float).reshape(-1, 3) for strip in strips]
        if not sum(map(len, arrays)):
            return
        self._entries["lines"].append(
            {
                **self._entry(path),
                **self._block.positions(np.concatenate(arrays)),
                "lengths": [len(strip) for strip in arrays],
                "colors": [bytes_of(color) for color in colors],
                "labels": labels,
            }
        )

    def boxes(
        self, path: str, boxes: list[Box], labels: list[str], colors: list[Color], *, show_labels: bool = True
    ) -> None:
        """See Canvas."""
        if boxes:
            corners = np.concatenate([box_corners(box) for box in boxes])
            rows = {"labels": labels, "colors": [bytes_of(color) for color in colors]}
            self._entries["boxes"].append({**self._entry(path), **self._block.positions(corners), **rows})

    def transform(self, path: str, parent_from_child: np.ndarray, scale: float = 1.0) -> None:
        """See Canvas."""
        matrix = np.asarray(parent_from_child, dtype=float).copy()
        matrix[:3, :3] *= scale
        rows = [round(float(value), 6) for value in matrix[:3].ravel()]
        self._entries["transforms"].append({**self._entry(path), "rows": rows})

    def joints(self, links: Sequence[JointedLink]) -> None:
        """See Canvas."""
        self._entries["joints"] += [
            {**vars(link), "parent_from_link": np.asarray(link.parent_from_link)[:3].ravel().tolist()} for link in links
        ]

    def camera(self, path: str, camera: Camera) -> None:
        """See Canvas; drawn as the pyramid of what it sees."""
        x = np.array([0, camera.width, camera.width, 0]) - camera.cx
        y = np.array([0, 0, camera.height, camera.height]) - camera.cy
        far = 0.3 * np.column_stack([x / camera.fx, y / camera.fy, np.ones(4)])
        strips = [np.concatenate([far, far[:1]]), *(np.array([np.zeros(3), corner]) for corner in far)]
        moment, self._time = self._time, None
        self.line(f"{path}/seen", strips, [(0.2, 0.4, 0.8)] * len(strips))
        self._pyramids.add(f"{path}/seen")
        self._time = moment

    def picture(self, path: str, data: bytes) -> None:
        """See Canvas."""
        self._pictures.append((path, self._time, data))

    def depth(self, path: str, depth: np.ndarray) -> None:
        """See Canvas; left out, which is said."""
        self._left_out.add("depth images")

    def label_names(self, path: str, rows: list[tuple[int, str, Color]]) -> None:
        """See Canvas; left out with the label images."""

    def labels(self, path: str, ids: np.ndarray) -> None:
        """See Canvas; left out, which is said."""
        self._left_out.add("label images")

    def graph(self, names: list[str], colors: list[Color], edges: list[tuple[str, str]]) -> None:
        """See Canvas."""
        self._graph = {"names": names, "colors": [bytes_of(color) for color in colors], "edges": edges}

    def trust(self, rows: Mapping[str, Trust]) -> None:
        """See Canvas."""
        for name, trust in rows.items():
            reasons = [cleaned(reason) for reason in trust.reasons]
            color = bytes_of(trust_color(trust.share))
            self._trust[name] = {"share": round(trust.share, 3), "reasons": reasons, "color": color}

    def explain(self, rows: Mapping[str, Sequence[str]]) -> None:
        """Say why things are what they are, by name: a click on one shows its sentences."""
        self._because = {cleaned(name): [cleaned(line) for line in lines] for name, lines in rows.items()}

    def moment(self, seconds: float, text: str, *, bad: bool = False) -> None:
        """See Canvas."""
        self._entries["moments"].append({"time": float(seconds), "text": cleaned(text), "bad": bad})

    def document(self, path: str, markdown: str) -> None:
        """See Canvas."""
        self._entries["documents"].append({**self._entry(path), "text": cleaned(markdown)})

    def _entry(self, path: str) -> dict[str, Any]:
        return {"path": path, "time": self._time}

    def _drawn_meshes(self) -> list[dict[str, Any]]:
        shapes = {shape_key(mesh.vertices): mesh.vertices for mesh in self._meshes}
        total = sum(map(len, shapes.values()))
        edge = next((edge for edge in EDGES if _thinned_to(shapes.values(), edge) <= MOST_VERTICES), EDGES[-1])
        drawn = []
        for mesh in self._meshes:
            vertices, faces, colors = mesh.vertices, mesh.faces, mesh.colors
            ids = None if mesh.parts is None else np.asarray(mesh.parts.ids)
            if total > MOST_VERTICES and len(vertices) > SMALL:
                vertices, faces, first = thinned_mesh(vertices, faces, edge)
                colors = None if colors is None else colors[first]
                ids = None if ids is None else ids[first]
            entry: dict[str, Any] = {"path": mesh.path, "time": mesh.time, **self._block.positions(vertices)}
            entry |= {"faces": self._block.put(faces.astype("<u4")), "front": mesh.front_only}
            if ids is not None and mesh.parts is not None:
                names = {str(k): cleaned(name) for k, name in sorted(mesh.parts.names.items())}
                entry |= {"parts": self._block.put(ids.astype("<u4")), "names": names}
            drawn.append(entry if colors is None else {**entry, "colors": self._block.put(colors)})
        if total > MOST_VERTICES:
            self._left_out.add(f"detail below {1000 * edge:g} mm")
        return drawn

    def _kept_pictures(self) -> list[dict[str, Any]]:
        total = sum(len(data) for _, _, data in self._pictures)
        every = max(1, -(-total // MOST_PICTURE_BYTES))
        if every > 1:
            self._left_out.add(f"all but each {every}th picture")
        pictures = []
        for path, moment, data in self._pictures[::every]:
            kind = "image/png" if data.startswith(PNG_START) else "image/jpeg"
            address = f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
            pictures.append({"path": path, "time": moment, "address": address})
        return pictures

    def _document(self) -> dict[str, Any]:
        meshes = self._drawn_meshes()
        if not np.isfinite(self._low).all():
            self._enclose_everything()
        low, high = (self._low, self._high) if np.isfinite(self._low).all() else (-np.ones(3), np.ones(3))
        return {
            "name": cleaned(self._name),
            "bounds": [low.tolist(), high.tolist()],
            "meshes": meshes,
            "pictures": self._kept_pictures(),
            "graph": self._graph,
            "trust": self._trust,
            "because": self._because,
            "left_out": sorted(self._left_out),
            **self._entries,
        }

    def _enclose_everything(self) -> None:
        """Keep all in sight where it is first placed, but for what cameras see."""
        bounds = [(mesh.path, mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) for mesh in self._meshes]
        for entry in (entry for kind in ("points", "lines", "boxes") for entry in self._entries[kind]):
            if entry["at"][1] and entry["path"] not in self._pyramids:
                low = np.array(entry["low"])
                bounds.append((entry["path"], low, low + STEPS * np.array(entry["step"])))
        placed: dict[str, np.ndarray] = {}
        for entry in self._entries["transforms"]:
            placed.setdefault(entry["path"], np.array([*entry["rows"], 0, 0, 0, 1]).reshape(4, 4))
        for path, low, high in bounds:
            names, world = path.split("/"), np.eye(4)
            for k in range(len(names)):
                world = world @ placed.get("/".join(names[: k + 1]), np.eye(4))
            corners = apply(world, trimesh.bounds.corners([low, high]))
            self.enclose(corners.min(axis=0), corners.max(axis=0))
        margin = MARGIN * (self._high - self._low)
        self._low, self._high = self._low - margin, self._high + margin

    def page(self, served: ServedPage | None = None) -> bytes:
        """Return the page; `served`: what it needs to talk to the server that it comes from."""
        page = page_text(self._document(), self._block, served)
        if len(page) > LARGEST_PAGE:
            raise BadInput(f"the page would have {len(page) / 1e6:.0f} MB", hint="save a .rrd file instead")
        return page

    def _write(self, save: Path) -> None:
        page = self.page()
        partial = save.with_name(f".{save.name}.partial-{os.getpid()}")
        try:
            save.parent.mkdir(parents=True, exist_ok=True)
            partial.write_bytes(page)
            partial.replace(save)
        except OSError as error:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            raise MachineFailure(f"{save}: {error.strerror}", hint="choose another --save") from None


def shape_key(vertices: np.ndarray) -> bytes:
    """Return a digest of vertices: a surface that is drawn in several colours is held once."""
    return hashlib.sha256(vertices.tobytes()).digest()


def _thinned_to(shapes: Iterable[np.ndarray], edge: float) -> int:
    """Return how many vertices are left of all shapes with cubes of `edge` [m]."""
    return sum(
        len(vertices) if len(vertices) <= SMALL else len(np.unique(cell_keys(vertices, edge))) for vertices in shapes
    )


def script_digests() -> tuple[str, ...]:
    """Return the digests of the scripts of a page that is not served, as a content security policy names them: a page
    that it stands in has to allow them."""
    return tuple(digest_of(script) for script in _scripts())


def digest_of(script: str) -> str:
    """Return `'sha256-...'` of a script."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _scripts() -> list[str]:
    return [three_js(), (FOLDER / "page.js").read_text(encoding="utf-8")]


def page_text(document: dict[str, Any], block: Block, served: ServedPage | None = None) -> bytes:
    """Return the page of a document. Everything in it that came from outside is data: JSON without a `<`, which the
    script shows as text. The policy in its head lets nothing run but the scripts that stand in it, and asks nobody but
    the server that a served page came from."""
    scripts = _scripts()
    if served is not None:
        scripts.append(served.script)
        document = {**document, "served": dict(served.facts)}
    hashes = " ".join(digest_of(script) for script in scripts)
    policy = f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'"
    policy += "; form-action 'none'" + ("" if served is None else "; connect-src 'self'")
    text = json.dumps(document, sort_keys=True, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    page = (FOLDER / "page.html").read_text(encoding="utf-8")
    for mark, value in (
        ("@policy@", policy),
        ("@style@", (FOLDER / "page.css").read_text(encoding="utf-8")),
        ("@library@", scripts[0]),
        ("@script@", "</script>\n<script>".join(scripts[1:])),
        ("@block@", block.text()),
        ("@document@", text.replace("<", "\\u003c")),
    ):
        before, _, after = page.partition(mark)
        page = before + value + after
    return page.encode("utf-8")
