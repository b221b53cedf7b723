"""What the folder formats share: numbered files, lazy loading, intrinsics that may be overridden."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from stages.ingest.images import decode_image, usable_color, usable_depth
from stages.ingest.parameters import IngestParameters
from stages.ingest.source import LoadedFrame, Unusable

COLOR_SUFFIXES = (".jpg", ".jpeg", ".png")
DEPTH_SUFFIXES = (".png", ".pgm", ".tif", ".tiff")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key that puts 10 after 9."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.findall(r"\d+|\D+", name))


def images_by_stem(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Return stem -> file of the images in a folder, in natural order. Raises BadInput when two share a stem."""
    found: dict[str, Path] = {}
    for path in sorted(
        (p for p in folder.iterdir() if p.suffix.lower() in suffixes), key=lambda p: natural_key(p.name)
    ):
        if path.stem in found:
            raise BadInput(f"{path}: {found[path.stem].name} has the same name", hint="keep one of the two")
        found[path.stem] = path
    return found


def first_subfolder(root: Path, names: tuple[str, ...]) -> Path | None:
    """Return the first of the named subfolders that exists."""
    return next((root / name for name in names if (root / name).is_dir()), None)


def image_loader(
    color: Path | None, depth: Path | None, camera: Camera, units_per_metre: float
) -> Callable[[], LoadedFrame]:
    """Return a function that reads and checks both images of a frame."""

    def load() -> LoadedFrame:
        if color is None:
            raise Unusable("missing_color")
        if depth is None:
            raise Unusable("missing_depth")
        return LoadedFrame(
            color=usable_color(color.read_bytes(), camera),
            depth=usable_depth(depth.read_bytes(), camera, units_per_metre),
        )

    return load


def depth_image_size(paths: list[Path]) -> tuple[int, int] | None:
    """Return (width, height) of the first depth image that decodes, None when none does."""
    for path in paths:
        image = decode_image(path.read_bytes())
        if image is not None:
            return image.shape[1], image.shape[0]
    return None


def overridden(camera: Camera, parameters: IngestParameters) -> tuple[Camera, tuple[str, ...]]:
    """Return the camera with the intrinsics that the user gave, and a note that names them."""
    given = {name: getattr(parameters, name) for name in ("fx", "fy", "cx", "cy")}
    given = {name: value for name, value in given.items() if value is not None}
    if not given:
        return camera, ()
    listed = ", ".join(f"{name} {value:g}" for name, value in given.items())
    return camera.model_copy(update=given), (f"intrinsics given by option: {listed}",)


def camera_from_options(size: tuple[int, int] | None, parameters: IngestParameters, why: str) -> Camera:
    """Return the camera that the options describe. Raises BadInput, telling `why`, unless all four are given."""
    names = ("fx", "fy", "cx", "cy")
    missing = [name for name in names if getattr(parameters, name) is None]
    if missing:
        raise BadInput(f"{why}: intrinsics are not known", hint="give " + " ".join(f"--{name}" for name in missing))
    width, height = size or (0, 0)
    return Camera(width=width, height=height, **{name: getattr(parameters, name) for name in names})


def depth_units(parameters: IngestParameters, default: float) -> tuple[float, str]:
    """Return depth units per metre and a note that says where the number comes from."""
    if parameters.depth_scale is not None:
        return parameters.depth_scale, f"depth unit given by option: 1/{parameters.depth_scale:g} m"
    return default, f"depth unit assumed: 1/{default:g} m"
