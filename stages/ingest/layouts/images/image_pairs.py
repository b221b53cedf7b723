"""Which images of a plain folder are colour, depth and right eye, and which of them belong together."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.depth_arrays import ARRAY_SUFFIXES
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    DEPTH_SUFFIXES,
    files_of,
    images_by_stem,
    natural_key,
)
from scenewright.stages.ingest.folders.video_frames import SUFFIXES as VIDEO_SUFFIXES

STEREO_FOLDERS = (
    ("left", "right"),
    ("image_0", "image_1"),
    ("image_2", "image_3"),
    ("cam0/data", "cam1/data"),
    ("image_left", "image_right"),
)
COLOR_FOLDERS = ("color", "rgb", "image", "images", "frames", "image_0", "image_2", "cam0/data")
DEPTH_FOLDERS = ("depth", "depths")
MARKED = re.compile(
    r"(?:(color|rgb|depth|left|right)[._-]?(.*)|(.*?)[._-]?(color|rgb|depth|left|right))", re.IGNORECASE
)
"""Names in one folder that say what an image is: `NAME.color.png`, `NAME_depth.png`, `left_0001.png`. Beside
`NAME_depth.png` an image `NAME.png` is colour."""
MIDDLEBURY = {"im0": ("left", ""), "im1": ("right", ""), "disp0": ("disparity", "")}
DEPTH_ENDINGS = (*DEPTH_SUFFIXES, *ARRAY_SUFFIXES, ".exr")
ROLES = {
    "color": "color",
    "rgb": "color",
    "left": "color",
    "depth": "depth",
    "right": "right",
    "disparity": "disparity",
}


@dataclass(frozen=True)
class FolderImages:
    """The images of a folder as frames. Every list is as long as `names`; a frame may lack any image."""

    names: tuple[str, ...]
    colors: tuple[Path | None, ...]
    depths: tuple[Path | None, ...]
    rights: tuple[Path | None, ...]
    camera_number: int
    """Which camera of a KITTI calibration the left images are of."""
    places: dict[str, str]
    """Role -> folder or names, for people."""
    depth_is_disparity: bool = False
    video: Path | None = None
    """The frames are those of this video, none of them listed."""
    notes: tuple[str, ...] = ()


def find_images(root: Path) -> FolderImages | None:
    """Return the images of a folder, None when it holds none in a way that is understood.

    Raises BadInput when images cannot be paired.
    """
    for left, right in STEREO_FOLDERS:
        if (root / left).is_dir() and (root / right).is_dir():
            return _of_folders(root, left, right)
    color = next((name for name in COLOR_FOLDERS if (root / name).is_dir() and _any_image(root / name)), None)
    if color is not None:
        return _of_folders(root, color, None)
    if not _any_image(root) and (depth := _depth_folder(root)) is not None:
        depths = images_by_stem(root / depth, DEPTH_ENDINGS)
        blank: tuple[None, ...] = (None,) * len(depths)
        return FolderImages(tuple(depths), blank, tuple(depths.values()), blank, 0, {"depth": depth})
    marked = _images_by_role(root)
    if marked is not None:
        return marked
    videos = files_of(root, VIDEO_SUFFIXES)
    if len(videos) == 1:
        return FolderImages((), (), (), (), 0, {"color": videos[0].name}, video=videos[0])
    plain = images_by_stem(root, COLOR_SUFFIXES)
    if plain:
        blank = (None,) * len(plain)
        return FolderImages(tuple(plain), tuple(plain.values()), blank, blank, 0, {"color": "."})
    return None


def has_images(root: Path) -> str | None:
    """Return in words what `find_images` would find, None for nothing. Cheap: no more than names are looked at."""
    for left, right in STEREO_FOLDERS:
        if (root / left).is_dir() and (root / right).is_dir():
            return f"{left}/ and {right}/"
    color = next((name for name in COLOR_FOLDERS if (root / name).is_dir() and _any_image(root / name)), None)
    if color is not None:
        depth = next((name for name in DEPTH_FOLDERS if (root / name).is_dir()), None)
        return f"{color}/ and {depth}/" if depth else f"{color}/"
    if not _any_image(root) and (depth := _depth_folder(root)) is not None:
        return f"{depth}/ and no colour"
    if len(files_of(root, VIDEO_SUFFIXES)) == 1 and not _any_image(root):
        return "one video file"
    return "image files" if _any_image(root) else None


def _depth_folder(root: Path) -> str | None:
    """Return the name of a folder of depth that holds some."""
    return next(
        (name for name in DEPTH_FOLDERS if (root / name).is_dir() and files_of(root / name, DEPTH_ENDINGS)), None
    )


def _any_image(folder: Path) -> bool:
    return any(path.suffix.lower() in COLOR_SUFFIXES and not path.name.startswith(".") for path in folder.iterdir())


def _of_folders(root: Path, color: str, right: str | None) -> FolderImages:
    colors = images_by_stem(root / color, COLOR_SUFFIXES)
    depth = next((name for name in DEPTH_FOLDERS if (root / name).is_dir()), None)
    depths = images_by_stem(root / depth, DEPTH_ENDINGS) if depth else {}
    rights = images_by_stem(root / right, COLOR_SUFFIXES) if right else {}
    places = {"color": color} | ({"depth": depth} if depth else {}) | ({"right": right} if right else {})
    notes: list[str] = []
    keys = _keys(root, [colors, depths, rights], notes)
    names = sorted({key for images in keys for key in images}, key=natural_key)
    columns = [tuple(images.get(name) for name in names) for images in keys]
    number = 2 if color == "image_2" else 0
    return FolderImages(tuple(names), columns[0], columns[1], columns[2], number, places, notes=tuple(notes))


def _keys(root: Path, images: list[dict[str, Path]], notes: list[str]) -> list[dict[str, Path]]:
    """Return the images under names that their partners share: equal names, else equal numbers, else their order."""
    first, others = images[0], [eye for eye in images[1:] if eye]
    if not others or all(first.keys() & eye.keys() for eye in others):
        return images
    numbered = [_by_number(eye) for eye in images]
    if all(eye is not None for eye in numbered):
        notes.append("images paired by the last number in their names")
        return [eye for eye in numbered if eye is not None]
    if any(len(eye) != len(first) for eye in others):
        counts = " and ".join(str(len(eye)) for eye in [first, *others])
        raise BadInput(f"{root}: {counts} images have no names or numbers in common", hint="give partners one name")
    notes.append("images paired by their order")
    return [dict(zip(first, eye.values(), strict=bool(eye))) for eye in images]


def _by_number(images: dict[str, Path]) -> dict[str, Path] | None:
    """Return the images by the last number in their names, None when a name has none or two have the same."""
    keyed: dict[str, Path] = {}
    for stem, path in images.items():
        numbers = re.findall(r"[0-9]+", stem)
        if not numbers:
            return None
        keyed[str(int(numbers[-1]))] = path
    return keyed if len(keyed) == len(images) else None


def _images_by_role(root: Path) -> FolderImages | None:
    """Return the images of a folder whose names say what they are."""
    roles: dict[str, dict[str, Path]] = {"color": {}, "depth": {}, "right": {}, "disparity": {}}
    plain: dict[str, Path] = {}
    for path in files_of(root, (*COLOR_SUFFIXES, ".pfm", ".npy")):
        match = MARKED.fullmatch(path.stem)
        word, name = MIDDLEBURY.get(path.stem.lower(), (None, ""))
        if word is None and match is not None:
            word, name = (match[1], match[2]) if match[1] else (match[4], match[3])
        if word is None:
            plain[path.stem] = path
            continue
        images = roles[ROLES[word.lower()]]
        if name in images:
            raise BadInput(f"{path}: {images[name].name} is the same image", hint="keep one of the two")
        images[name] = path
    if not roles["color"]:
        roles["color"] = {name: path for name, path in plain.items() if name in roles["depth"]}
    if not roles["color"] or not (roles["depth"] or roles["right"] or roles["disparity"]):
        return None
    names = sorted({name for images in roles.values() for name in images}, key=natural_key)
    depths = roles["depth"] or roles["disparity"]
    columns = [tuple(images.get(name) for name in names) for images in (roles["color"], depths, roles["right"])]
    places = {role: f"*{role}*" for role in ("color", "depth", "right") if roles[role]}
    if depths:
        places["depth"] = "*depth*" if roles["depth"] else "disp0"
    return FolderImages(
        tuple(name or "pair" for name in names),
        columns[0],
        columns[1],
        columns[2],
        0,
        places,
        depth_is_disparity=not roles["depth"] and bool(depths),
    )


def stamps_of(names: tuple[str, ...]) -> np.ndarray | None:
    """Return the stamps (N,) int64 [ns] that file names are, when all are times since 1970: whole nanoseconds (19
    digits), microseconds (16), milliseconds (13) or seconds with decimals."""
    stamps = []
    for name in names:
        digits = re.fullmatch(r"[0-9]{13}|[0-9]{16}|[0-9]{19}", name)
        seconds = re.fullmatch(r"([0-9]{9,10})\.([0-9]{1,9})", name)
        if digits:
            stamps.append(int(name.ljust(19, "0")))
        elif seconds:
            stamps.append(int(seconds[1]) * 10**9 + int(seconds[2].ljust(9, "0")))
        else:
            return None
    return np.array(stamps, np.int64) if stamps and max(stamps) < 2**63 else None
