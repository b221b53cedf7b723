"""What the folder formats share: numbered and named files, intrinsics that may be overridden, streams."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.outside import file_content, json_of
from scenewright.schemas.places import resolved
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.depth_arrays import ARRAY_SUFFIXES, depth_array
from scenewright.stages.ingest.folders.exr_depth import EXR_SUFFIX, exr_depth
from scenewright.stages.ingest.images import DepthForm, decode_as_calibrated, decode_image, usable_color, usable_depth
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import LoadedFrame, Role, StreamInfo, Unusable
from scenewright.stages.kit.formats.trajectories import read_text
from scenewright.stages.kit.geometry.cameras import scaled

COLOR_SUFFIXES = (".jpg", ".jpeg", ".png", ".ppm", ".pgm", ".bmp", ".tif", ".tiff", ".webp")
DEPTH_SUFFIXES = (".png", ".pgm", ".tif", ".tiff")
FARTHEST = 65.534
"""Largest depth that a sequence holds [m]."""
LARGEST_IMAGE_FILE = 1_000_000_000
"""Bytes of an image file that are read."""


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key that puts 10 after 9."""
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.findall(r"\d+|\D+", name))


def files_of(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Return the files with these suffixes in a folder, in natural order; hidden ones (editors, archives) are none."""
    candidates = (
        path for path in folder.iterdir() if path.suffix.lower() in suffixes and not path.name.startswith(".")
    )
    return sorted((path for path in candidates if not path.is_dir()), key=lambda path: natural_key(path.name))


def images_by_stem(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Return stem -> file of the images in a folder, in natural order.

    Raises BadInput when two share a stem, or have stems that differ only in case.
    """
    images: dict[str, Path] = {}
    folded: dict[str, Path] = {}
    for path in files_of(folder, suffixes):
        same_stem = folded.setdefault(path.stem.casefold(), path)
        if same_stem is not path:
            same = "has the same name" if same_stem.stem == path.stem else "differs only in case"
            raise BadInput(f"{path}: {same_stem.name} {same}", hint="keep one of the two")
        images[path.stem] = path
    return images


def images_by_number(folder: Path, suffixes: tuple[str, ...], prefix: str = "") -> dict[int, Path]:
    """Return number -> file of the images in a folder; the number is the last one in the name, as in depth00012.png.

    Only names that begin with `prefix` count. Raises BadInput when a name has none, or two have the same.
    """
    images: dict[int, Path] = {}
    for path in (path for path in files_of(folder, suffixes) if path.name.startswith(prefix)):
        numbers = re.findall(r"\d+", path.stem)
        if not numbers:
            raise BadInput(f"{path}: has no frame number in its name", hint="number it, or take it out of the folder")
        number = int(numbers[-1])
        if number in images:
            raise BadInput(f"{path}: {images[number].name} has the same frame number", hint="keep one of the two")
        images[number] = path
    return dict(sorted(images.items()))


def images_of_subfolder(folder: Path | None, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Return `images_by_stem` of a folder, nothing where the log has no such folder. Raises BadInput."""
    return {} if folder is None else images_by_stem(folder, suffixes)


def first_subfolder(root: Path, names: tuple[str, ...]) -> Path | None:
    """Return the first of the named subfolders that exists."""
    return next((root / name for name in names if (root / name).is_dir()), None)


def named_file(root: Path, name: Any, where: str) -> Path:
    """Return the file that a log names, whether it exists or not. Where no file is called so, a backslash separates
    folders, as on Windows.

    Raises BadInput when the name is no name, or leads out of the folder `root`, by `..`, from the root of the file
    system, or over a link.
    """
    if not isinstance(name, str) or not name.strip() or "\0" in name or len(name) > 4096:
        raise BadInput(f"{where}: {name!r:.60} is not a file name", hint="name a file of the log")
    if "\\" in name and not (root / name).exists():
        name = name.replace("\\", "/")
    path = root / name
    try:
        inside = not Path(name).is_absolute() and resolved(path).is_relative_to(root.resolve())
    except (OSError, RuntimeError):  # a loop of links, a name too long
        inside = False
    if not inside:
        raise BadInput(
            f"{where}: {name!r:.120} leads out of the folder", hint="names in a log must stay within its folder"
        )
    return path


def read_json(path: Path) -> Any:
    """Return the document in a JSON file. Raises BadInput."""
    return json_of(read_text(path), str(path), hint="correct it, or copy it again")


def file_bytes(path: Path, stream: str) -> bytes:
    """Return the bytes of an image file. Raises Unusable naming the `stream` when it is missing or cannot be read."""
    if not os.path.exists(path):
        raise Unusable(f"missing_{stream}", path.name)
    if (size := path.stat().st_size) > LARGEST_IMAGE_FILE:
        raise Unusable(f"undecodable_{stream}", f"file of {size} bytes")
    try:
        return file_content(path, LARGEST_IMAGE_FILE)
    except BadInput as error:
        raise Unusable(f"unreadable_{stream}", f"{path.name}: {error.message.rpartition(': ')[2]}") from None


def image_loader(
    color: Path | None,
    depth: Path | None,
    camera: Camera,
    form: DepthForm,
    *,
    has_color: bool = True,
    decoded: bool = False,
) -> Callable[[], LoadedFrame]:
    """Return a function that reads and checks both images of a frame, the colour `decoded` for who resamples it.

    `has_color`: whether the log has colour at all, without which a frame of it is unusable then.
    """

    def load() -> LoadedFrame:
        if color is None and has_color:
            raise Unusable("missing_color")
        if depth is None:
            raise Unusable("missing_depth")
        return LoadedFrame(
            color=None if color is None else usable_color(file_bytes(color, "color"), camera, decoded=decoded),
            depth=usable_depth(file_bytes(depth, "depth"), camera, form),
        )

    return load


def raw_depth(path: Path) -> np.ndarray:
    """Return a depth image or array as it is in its file, (H, W) uint16 or float. Raises Unusable."""
    data = file_bytes(path, "depth")
    if path.suffix.lower() in ARRAY_SUFFIXES:
        return depth_array(data, path.suffix.lower())
    if path.suffix.lower() == EXR_SUFFIX:
        return exr_depth(data)
    image = decode_image(data)
    if image is None:
        raise Unusable("undecodable_depth", f"{path.name}: {len(data)} bytes")
    if image.dtype == np.uint8:
        raise Unusable("depth_not_16_bit", "8-bit image, probably a picture of depth made for people")
    return image


def depth_image_size(paths: Iterable[Path]) -> tuple[int, int] | None:
    """Return (width, height) of the first depth image that decodes, None when none does."""
    for path in paths:
        try:
            if path.suffix.lower() in (*ARRAY_SUFFIXES, EXR_SUFFIX):
                image: np.ndarray | None = raw_depth(path)
            else:
                image = decode_image(file_bytes(path, "depth"))
        except Unusable:
            continue
        if image is not None:
            return image.shape[1], image.shape[0]
    return None


def color_image_size(paths: Iterable[Path], stated: tuple[int, int] = (0, 0)) -> tuple[int, int] | None:
    """Return (width, height) of the first colour image that decodes, None when none does.

    Where the calibration states a size, that of a picture which its EXIF orientation turns into that shape is turned.
    """
    for path in paths:
        try:
            image = decode_as_calibrated(file_bytes(path, "color"), stated)
        except Unusable:
            continue
        if image is not None:
            return image.shape[1], image.shape[0]
    return None


def resized_camera(camera: Camera, size: tuple[int, int] | None, where: str) -> Camera:
    """Return the camera of images of `size` (width, height): the same picture, larger or smaller.

    A camera of unknown size (0) takes the size as it is. Raises BadInput when the shape is another.
    """
    if size is None or size == (camera.width, camera.height):
        return camera
    width, height = size
    if 0 in (camera.width, camera.height):
        return camera.model_copy(update={"width": width, "height": height})
    if abs(width * camera.height - height * camera.width) > max(camera.width, camera.height, width, height):
        raise BadInput(
            f"{where}: intrinsics are for {camera.width}x{camera.height}, the images are {width}x{height}",
            hint="give --fx --fy --cx --cy",
        )
    return scaled(camera, width / camera.width).model_copy(update={"width": width, "height": height})


def pinhole(numbers: Iterable[Any], size: tuple[int, int] | None, where: str) -> Camera:
    """Return the camera of the four `numbers` fx fy cx cy from a file, for images of `size` (width, height).

    Raises BadInput when they are no numbers, not finite, or focal lengths are not positive.
    """
    try:
        values = [float(value) for value in numbers]
    except (TypeError, ValueError, OverflowError):
        raise BadInput(f"{where}: intrinsics are not numbers", hint="give --fx --fy --cx --cy") from None
    if (
        len(values) != 4
        or not np.isfinite(values).all()
        or values[0] <= 0
        or values[1] <= 0
        or max(map(abs, values)) > 1e9
    ):
        raise BadInput(
            f"{where}: fx fy cx cy = {' '.join(f'{value:g}' for value in values)} are those of no camera",
            hint="give --fx --fy --cx --cy",
        )
    width, height = size or (0, 0)
    return Camera(width=width, height=height, fx=values[0], fy=values[1], cx=values[2], cy=values[3])


def all_intrinsics_given(parameters: IngestParameters) -> bool:
    """Whether the options describe a whole camera, so that what the log says of it does not count."""
    return all(getattr(parameters, name) is not None for name in ("fx", "fy", "cx", "cy"))


def overridden(camera: Camera, parameters: IngestParameters) -> tuple[Camera, tuple[str, ...]]:
    """Return the camera with the intrinsics that the user gave, and a note that names them."""
    given_intrinsics = {name: getattr(parameters, name) for name in ("fx", "fy", "cx", "cy")}
    given_intrinsics = {name: value for name, value in given_intrinsics.items() if value is not None}
    if not given_intrinsics:
        return camera, ()
    listed = ", ".join(f"{name} {value:g}" for name, value in given_intrinsics.items())
    return camera.model_copy(update=given_intrinsics), (f"intrinsics given by option: {listed}",)


def camera_from_options(size: tuple[int, int] | None, parameters: IngestParameters, why: str) -> Camera:
    """Return the camera that the options describe. Raises BadInput, telling `why`, unless all four are given."""
    names = ("fx", "fy", "cx", "cy")
    missing = [name for name in names if getattr(parameters, name) is None]
    if missing:
        raise BadInput(f"{why}: intrinsics are not known", hint="give " + " ".join(f"--{name}" for name in missing))
    width, height = size or (0, 0)
    return Camera(width=width, height=height, **{name: getattr(parameters, name) for name in names})


def depth_form(
    parameters: IngestParameters, default: float, depths: Iterable[Path | None] = (), stated: float | None = None
) -> tuple[DepthForm, str]:
    """Return how depth is stored, and a note that says where the unit comes from.

    `default` units per metre are those of the layout for whole numbers, `stated` those of the calibration file. The
    `depths` of a layout that says nothing of floating point are looked at: such depth is in metres by habit, unless its
    median is farther than a sequence can hold.
    """
    if parameters.depth_scale is not None:
        unit = f"depth unit given by option: 1/{parameters.depth_scale:g} m"
        return DepthForm(parameters.depth_scale, parameters.depth_bits), unit
    if stated is not None:
        return DepthForm(stated, parameters.depth_bits), f"depth unit stated by the calibration: 1/{stated:g} m"
    first = next((image for path in depths if path is not None and (image := _readable_depth(path)) is not None), None)
    if first is not None and first.dtype.kind == "f":
        valid = first[np.isfinite(first) & (first > 0)]
        if len(valid) and float(np.median(valid)) < FARTHEST:
            return DepthForm(1.0, parameters.depth_bits), "depth unit assumed: 1/1 m, as it is floating point"
    return DepthForm(default, parameters.depth_bits), f"depth unit assumed: 1/{default:g} m"


def _readable_depth(path: Path) -> np.ndarray | None:
    try:
        return raw_depth(path)
    except Unusable:
        return None


def chosen_cameras(counts: dict[str, int], parameters: IngestParameters, where: str) -> tuple[str, ...]:
    """Return the cameras to use among name -> number of frames: those asked for, else the one with most frames.

    Raises UsageError for a camera that the log has not.
    """
    if parameters.camera == ("all",):
        return tuple(counts)
    unknown = [name for name in parameters.camera if name not in counts]
    if unknown:
        raise UsageError(
            f"{where}: has no camera {unknown[0]!r}", hint=f"it has {', '.join(counts)}; 'all' takes every one"
        )
    if parameters.camera:
        return tuple(dict.fromkeys(parameters.camera))
    return (max(counts, key=lambda name: counts[name]),)


def stream(name: str, role: Role, paths: Iterable[Path], stamps: np.ndarray | None = None) -> StreamInfo:
    """Return the description of a folder of files, with its stamps (N,) [ns] where it has any."""
    suffixes = [path.suffix.lower() for path in paths]
    kinds = ", ".join(f"{suffixes.count(suffix)} {suffix or 'nameless'}" for suffix in sorted(set(suffixes)))
    stamps = np.zeros(0, np.int64) if stamps is None else np.asarray(stamps, np.int64)
    return StreamInfo(name, role, f"files: {kinds or 'none'}", stamps, len(suffixes))


def text_stream(name: str, role: Role, count: int, stamps: np.ndarray | None = None) -> StreamInfo:
    """Return the description of a text file with `count` records, with their stamps (N,) [ns] where it has any."""
    return StreamInfo(name, role, "text", np.zeros(0, np.int64) if stamps is None else stamps, count)
