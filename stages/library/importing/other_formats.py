"""Model files of formats that are not read, and what to do with each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from scenewright.stages.library.importing.source_folder import SourceFolder

_BLENDER = "open it in Blender and export GLB"
_CAD = "open it in FreeCAD and export OBJ or GLB"
WAYS: dict[str, str] = {
    ".xacro": "xacro is a program that writes URDF: xacro {name} > {stem}.urdf",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), f"USD is not read: {_BLENDER}"),
    ".fbx": f"FBX is not read: {_BLENDER}",
    ".blend": f"Blender's own files are not read: {_BLENDER}",
    ".abc": f"Alembic is not read: {_BLENDER}",
    **dict.fromkeys((".x3d", ".wrl", ".vrml"), f"X3D and VRML are not read: {_BLENDER}"),
    **dict.fromkeys(
        (".3ds", ".max", ".skp", ".c4d", ".ma", ".mb"), "its format is not read: export GLB from its program"
    ),
    **dict.fromkeys((".step", ".stp", ".iges", ".igs", ".fcstd", ".3dm"), f"CAD solids are not read: {_CAD}"),
    ".mjb": "a compiled MuJoCo model is not read: save it as XML (mujoco.mj_saveLastXML)",
    **dict.fromkeys((".zip", ".7z", ".rar", ".tar", ".gz", ".tgz", ".zae", ".mjz"), "an archive: unpack it"),
    **dict.fromkeys((".off", ".3mf", ".msh"), "its format is not read: open it in MeshLab and export PLY"),
}
"""Ending -> what is said; `{name}` and `{stem}` are those of the file."""
READ = (".urdf", ".sdf", ".world", ".xml", ".mjcf", ".obj", ".stl", ".dae", ".glb", ".gltf", ".ply")


def other_formats(folder: SourceFolder, files: Sequence[Path]) -> Iterator[tuple[str, str]]:
    """Yield (first file, what is said) for each kind of file that is not read.

    One beside files that are read is taken for their source (a .blend beside its .glb), and not spoken of.
    """
    endings_in: dict[Path, set[str]] = {}
    for path in files:
        if path.name != "package.xml":
            endings_in.setdefault(path.parent, set()).add(path.suffix.lower())
    found: dict[str, list[Path]] = {}
    for path in files:
        ending = path.suffix.lower()
        if ending in WAYS and endings_in[path.parent].isdisjoint({".urdf"} if ending == ".xacro" else READ):
            found.setdefault(WAYS[ending], []).append(path)
    for way, paths in found.items():
        stem = paths[0].name.split(".")[0]
        more = f", and {len(paths) - 1} more like it" if len(paths) > 1 else ""
        yield folder.relative(paths[0]), way.format(name=paths[0].name, stem=stem) + more
