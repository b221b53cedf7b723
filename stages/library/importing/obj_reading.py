"""OBJ files with their material libraries: triangles by material and group, painted.

After Wavefront's specification (Object files and MTL). Colours behind the coordinates of a vertex are MeshLab's habit.
"""

from __future__ import annotations

import io
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.library.importing.limits import MOST_SHAPES, MOST_TRIANGLES, MOST_VERTICES, SIMPLIFY
from scenewright.stages.library.importing.pictures import Pictures, face_colors
from scenewright.stages.library.importing.source_folder import LARGEST_TEXT, SourceFolder
from scenewright.stages.library.importing.source_model import Declared, MeshContent, Surface, painted_faces

LARGEST_MATERIALS = 16 * 2**20
"""Most bytes of all material files of a mesh; a bound, by eye."""
MOST_MATERIAL_FILES = 100
"""Most material files of a mesh that are looked at; a bound, by eye."""
MOST_LINES = 20_000_000
"""Most lines of an OBJ file; a bound, by eye."""
LONGEST_LINE = 1 << 20
"""Characters of a line of an OBJ file, those that a backslash continues together."""
WITHOUT_SHAPE = frozenset(
    {*("vn", "vp", "s", "p", "l", "mg", "bevel", "c_interp", "d_interp", "lod", "usemap", "maplib", "shadow_obj")}
    | {*("trace_obj", "parm", "trim", "hole", "scrv", "sp", "end", "con", "ctech", "stech", "deg", "bmat", "step")}
    | {"cstype"}
)
"""Words of lines that hold no triangles, or belong to a curve or surface that is counted by itself."""
FREE_FORMS = {**dict.fromkeys(("curv", "curv2"), "free-form curves"), "surf": "free-form surfaces"}
MAP_OPTIONS = {
    **dict.fromkeys(("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type"), 1),
    "-mm": 2,
}
"""Options before the name of a picture, by how many values they have; -o, -s and -t have one to three numbers."""


@dataclass
class _Block:
    """Triangles of one material and group while they are gathered: three numbers each."""

    corners: array[int] = field(default_factory=lambda: array("q"))
    mapped: array[int] = field(default_factory=lambda: array("q"))


@dataclass(frozen=True)
class Material:
    """Diffuse colour, and the picture on it with how its texture points are scaled and shifted."""

    color: tuple[float, float, float] | None = None
    picture: str | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    shift: tuple[float, float] = (0.0, 0.0)


class _Lines:
    """What the lines of an OBJ say."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.vertices, self.texture, self.colors = array("d"), array("d"), array("d")
        self.blocks: dict[tuple[str, str], _Block] = {}
        self.libraries: dict[str, None] = {}
        self.left_out: dict[str, int] = {}
        self.material = self.group = ""
        self.triangles = 0

    def take(self, line: str) -> None:
        """Take one line. Raises BadInput for too much; ValueError and IndexError for what is none of an OBJ."""
        word, *rest = line.strip().split(None, 1)
        arguments = rest[0] if rest else ""
        if word == "v":
            values = [float(number) for number in arguments.split()]
            x, y, z = values[:3]
            self.vertices.extend((x, y, z))
            if len(values) >= 6:
                self.colors.extend(values[3:6])
        elif word == "vt":
            u, v = (float(number) for number in (arguments.split() + ["0"])[:2])
            self.texture.extend((u, v))
        elif word in ("f", "fo"):
            self._face(arguments.split())
        elif word == "usemtl":
            self.material = arguments.strip()
        elif word in ("g", "o"):
            self.group = arguments.strip()
        elif word == "mtllib":
            self.libraries[arguments.strip()] = None
        elif word not in WITHOUT_SHAPE and not word.startswith("#"):
            what = FREE_FORMS.get(word, f"lines of {word!r:.20}")
            if len(self.left_out) < MOST_MATERIAL_FILES or what in self.left_out:
                self.left_out[what] = self.left_out.get(what, 0) + 1
        if len(self.vertices) > 3 * MOST_VERTICES or len(self.texture) > 2 * MOST_VERTICES:
            raise BadInput(f"{self.path}: more than {MOST_VERTICES} vertices", hint=SIMPLIFY)

    def _face(self, words: list[str]) -> None:
        corners = [part.split("/") for part in words]
        at = [_index(corner[0], len(self.vertices) // 3) for corner in corners]
        mapped = [_index(c[1], len(self.texture) // 2) if len(c) > 1 and c[1] else -1 for c in corners]
        block = self.blocks.setdefault((self.material, self.group), _Block())
        for k in range(1, len(at) - 1):
            block.corners.extend((at[0], at[k], at[k + 1]))
            block.mapped.extend((mapped[0], mapped[k], mapped[k + 1]))
        self.triangles += max(len(at) - 2, 0)
        if self.triangles > MOST_TRIANGLES or len(self.blocks) > MOST_SHAPES:
            most = f"{MOST_TRIANGLES} triangles or {MOST_SHAPES} groups"
            raise BadInput(f"{self.path}: more than {most}", hint=SIMPLIFY)

    def vertex_colors(self) -> np.ndarray | None:
        """Return (V, 3) colours in 0..1 when every vertex has one, else None."""
        if not self.colors or len(self.colors) != len(self.vertices):
            return None
        colors = np.array(self.colors).reshape(-1, 3)
        return np.clip(colors / (255.0 if colors.max() > 1.0 else 1.0), 0.0, 1.0)


def read_obj(folder: SourceFolder, path: Path) -> MeshContent:
    """Return the triangles of an OBJ; groups and objects give the surfaces their names. Raises BadInput."""
    data = folder.read(path, LARGEST_TEXT)
    if b"\0" in data:
        raise BadInput(f"{path}: no OBJ: holds zero bytes")
    said, number, line = _Lines(path), 0, ""
    try:
        for line in text_lines(data, path):
            number += 1
            if not line.isspace():
                said.take(line)
    except IndexError as error:
        raise BadInput(f"{path}: line {number}: {error}"[:200]) from None
    except ValueError:
        raise BadInput(f"{path}: line {number} is none of an OBJ: {line.strip()!r:.60}") from None
    blocks = {key: block for key, block in said.blocks.items() if block.corners}  # two corners make no triangle
    findings = [f"{path.name}: {what} left out ({count})" for what, count in said.left_out.items()]
    if not said.vertices or not blocks:
        raise BadInput(f"{path}: holds no triangles", hint="; ".join(findings[:2]))
    if len(said.libraries) > MOST_MATERIAL_FILES:
        findings.append(f"{path.name}: {MOST_MATERIAL_FILES} of {len(said.libraries)} material files are looked at")
    materials = _read_materials(folder, path, list(said.libraries), findings)
    points = np.array(said.vertices, dtype=float).reshape(-1, 3)
    uv, of_vertices = np.array(said.texture, dtype=float).reshape(-1, 2), said.vertex_colors()
    pictures = Pictures(folder, path, findings)
    surfaces = []
    for (name, group), block in blocks.items():
        faces, chosen = np.array(block.corners).reshape(-1, 3), np.array(block.mapped).reshape(-1, 3)
        material = materials.get(name, Material())
        colors = painted_faces(len(faces), material.color)
        picture = None
        if material.picture is not None and len(uv) and chosen.min() >= 0:
            picture = pictures.picture(material.picture)
        if picture is not None:
            colors = face_colors(picture, uv[chosen] * material.scale + material.shift)
        elif of_vertices is not None:
            colors = np.round(255 * of_vertices[faces].mean(axis=1)).astype(np.uint8)
        used, inverse = np.unique(faces, return_inverse=True)
        surfaces.append(Surface(points[used], inverse.reshape(-1, 3), colors, f"{group} {name}".strip()))
    return MeshContent(tuple(surfaces), Declared(None, "assumed"), Declared(None, "assumed"), tuple(findings))


def text_lines(data: bytes, path: Path) -> Iterator[str]:
    """Yield the lines of a text, whatever ends them, those that a backslash continues as one.

    Raises BadInput for one that does not end.
    """
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8", errors="replace")
    count, start = 0, ""
    while line := text.readline(LONGEST_LINE):
        count += 1
        if len(start) + len(line) >= LONGEST_LINE:
            raise BadInput(f"{path}: a line of {LONGEST_LINE} characters or more", hint="it may be no text of lines")
        if count > MOST_LINES:
            raise BadInput(f"{path}: more than {MOST_LINES} lines", hint=SIMPLIFY)
        if line.rstrip().endswith("\\") and line.endswith("\n"):
            start += line.rstrip()[:-1] + " "
            continue
        yield start + line
        start = ""
    if start:
        yield start


def _index(text: str, count: int) -> int:
    number = int(text)
    number = number - 1 if number > 0 else count + number
    if not 0 <= number < count:
        raise IndexError(f"a face names element {text} of {count}")
    return number


def _read_materials(folder: SourceFolder, path: Path, libraries: list[str], findings: list[str]) -> dict[str, Material]:
    """Return material -> colour and picture of the MTL files that can be found.

    A line may name one file whose name has blanks, or several.
    """
    materials: dict[str, Material] = {}
    found_files: dict[Path | None, None] = {}
    for name in libraries[:MOST_MATERIAL_FILES]:
        whole = folder.find(name, path.parent)
        names = [name] if whole is not None else name.split()[:MOST_MATERIAL_FILES]
        files = [folder.find(part, path.parent) for part in names]
        if None in files:
            findings.append(f"{path.name}: material file {Path(name).name!r:.60} is not there")
        found_files.update(dict.fromkeys(files))
    remaining_bytes = LARGEST_MATERIALS
    for file in list(found_files)[:MOST_MATERIAL_FILES]:
        if file is None:
            continue
        current = ""
        data = folder.read(file, remaining_bytes)
        remaining_bytes -= len(data)
        for line in text_lines(data, file):
            word, *rest = line.strip().split(None, 1) or [""]
            arguments = rest[0] if rest else ""
            if word == "newmtl":
                current = arguments.strip()
                materials.setdefault(current, Material())
            elif word == "Kd" and current:
                materials[current] = _with_color(materials[current], arguments)
            elif word.lower() == "map_kd" and current and arguments.strip():
                materials[current] = _with_picture(materials[current], arguments)
    return materials


def _with_color(material: Material, arguments: str) -> Material:
    try:
        red, green, blue = (float(x) for x in arguments.split()[:3])
    except ValueError:
        return material
    color = (red, green, blue) if np.isfinite([red, green, blue]).all() else material.color
    return Material(color, material.picture, material.scale, material.shift)


def _with_picture(material: Material, arguments: str) -> Material:
    """Return the material with a picture; its name is what is left of the line after the options, blanks and all."""
    rest, changes = arguments.strip(), {"-s": (1.0, 1.0), "-o": (0.0, 0.0)}
    while rest.startswith("-"):
        option, _, after = rest.partition(" ")
        if option in MAP_OPTIONS:
            rest = after.split(None, MAP_OPTIONS[option])[-1] if len(after.split()) > MAP_OPTIONS[option] else ""
        elif option in ("-s", "-o", "-t"):
            values: list[float] = []
            while len(values) < 3 and after and (number := _number(after.split(None, 1)[0])) is not None:
                values.append(number)
                after = (after.split(None, 1) + [""])[1]
            u, v = ([*values, *changes.get(option, (0.0, 0.0))[len(values) :]] + [0.0, 0.0])[:2]
            changes[option] = (u, v)
            rest = after.strip()
        else:
            break
    return Material(material.color, rest or None, changes["-s"], changes["-o"])


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None
