"""Finding SceneNN's scenes in a folder: frames, trajectory, and both halves of the annotation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenewright.stages.ingest.layouts.scenenn import reader as scenenn

FRAMES = ("", "main", "scenes")
"""Folders below the data's in which scenes may lie."""


@dataclass(frozen=True)
class Scene:
    """One scene with everything that the tables need."""

    name: str
    log: Path
    """Folder with frames and trajectory.log."""
    annotation: Path
    mesh: Path


def find_scene(name: str, data: Path, annotations: Path | None = None) -> Scene | str:
    """Return the scene called `name`, or what is missing of it, in words.

    Frames lie in `data`/<name>, `data`/main/<name> or `data`/scenes/<name>; the annotation beside them or, where
    `annotations` is given (another version of it), as `annotations`/<name>/<name>.xml and .ply, or without the folder.
    """
    folders = [data / above / name for above in FRAMES if (data / above / name).is_dir()]
    if not folders:
        return "no folder"
    folder = next((found for found in folders if scenenn.matches(found)), None)
    if folder is None:
        return _missing_frames(folders[0], data, name)
    roots = (folder,) if annotations is None else (annotations / name, annotations)
    missing = []
    for suffix in (".xml", ".ply"):
        if not any((root / f"{name}{suffix}").is_file() for root in roots):
            missing.append(f"{name}{suffix}")
    if missing:
        return f"no {' and no '.join(missing)}"
    xml, ply = (
        next(path for root in roots if (path := root / f"{name}{suffix}").is_file()) for suffix in (".xml", ".ply")
    )
    return Scene(name, folder, xml, ply)


def _missing_frames(folder: Path, data: Path, name: str) -> str:
    missing = [
        what
        for what, there in (
            ("image/ (or rgb/)", any((folder / color).is_dir() for color in scenenn.COLOR_FOLDERS)),
            ("depth/", (folder / "depth").is_dir()),
            (scenenn.TRAJECTORY, (folder / scenenn.TRAJECTORY).is_file()),
        )
        if not there
    ]
    text = f"no {', no '.join(missing)}" if missing else "neither timestamp.txt, asus.ini nor depth<number>.png"
    recording = next((path for path in (data / "oni" / f"{name}.oni", folder / f"{name}.oni") if path.is_file()), None)
    return f"{text}; extract {recording} with the data set's playback tool" if recording else text
