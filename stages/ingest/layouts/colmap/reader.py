"""COLMAP projects: images/ and a sparse model, with depth/ or COLMAP's own dense maps when they are there.

Where there is depth the images may be missing.

Poses in the files are camera-from-world, OpenCV axes; they are inverted. Pixel coordinates put the centre of the first
pixel at (0.5, 0.5); ours are half a pixel less. Worlds from pictures alone have no scale.
"""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.folders.camera_groups import CameraGroup, grouped
from scenewright.stages.ingest.folders.exr_depth import require_exr
from scenewright.stages.ingest.folders.files import (
    COLOR_SUFFIXES,
    DEPTH_SUFFIXES,
    chosen_cameras,
    color_image_size,
    depth_form,
    depth_image_size,
    first_subfolder,
    named_file,
    natural_key,
    pinhole,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameFormat, frame_loader, kept_pictures, picture_camera
from scenewright.stages.ingest.folders.undistortion import PINHOLE, RecordedCamera, lens_of, overridden_recording
from scenewright.stages.ingest.layouts.colmap.model import ModelCamera, ModelImage, SparseModel, has_model, read_model
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LoadedFrame, LogSource, SourceCamera, Unusable

IMAGE_FOLDERS = ("images", "image", "rgb", "color")
DENSE_MAPS = "stereo/depth_maps"
DENSE_ENDINGS = (".geometric.bin", ".photometric.bin")
"""Endings of depth maps in the order in which they are preferred: geometric ones were checked against other views."""

ONE_FOCAL_LENGTH = (
    "SIMPLE_PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "SIMPLE_FISHEYE",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
)
TWO_FOCAL_LENGTHS = ("PINHOLE", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FISHEYE")
"""Models that are OpenCV's, with some coefficients zero."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not root.is_dir():
        return None
    folders = _model_folders(root)
    if not folders:
        return None
    folder = folders[0].relative_to(root).as_posix()
    return f"folder with cameras and images files in {'it' if folder == '.' else folder + '/'}: COLMAP sparse model"


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the images of a COLMAP project. Raises BadInput for damaged models, names outside of the folder, and
    cameras that cannot be undistorted."""
    model, model_notes, damage = _largest_model(root, parameters)
    image_folder = first_subfolder(root, IMAGE_FOLDERS) or root
    images = sorted(model.images, key=lambda image: natural_key(image.name))
    if not images:
        raise BadInput(f"{model.folder}: no image is registered in the model", hint="COLMAP did not find any pose")
    colors = [named_file(image_folder, image.name, str(model.folder)) for image in images]
    depths, depth_words = _depths(root, images)
    require_exr(path.name for path in depths if path)
    has_depth = depth_words is not None
    has_color = not has_depth or any(path.is_file() for path in colors)
    recorded, notes_of_options = _recorded_cameras(model, images, colors, depths, parameters)
    groups, group_notes = grouped(recorded, [str(image.camera) for image in images])
    unregistered = _unregistered_images(image_folder, colors)
    counts = {group.name: len(group.members) for group in groups}
    chosen = chosen_cameras(counts, parameters, str(root))
    stored, unit_note = (
        depth_form(parameters, 1.0) if depth_words == DENSE_MAPS else depth_form(parameters, 1000.0, depths)
    )
    group_of = {index: group for group in groups for index in group.members}
    pictures = {
        group.name: kept_pictures((colors[k] for k in group.members), group.camera) if has_depth else None
        for group in groups
    }
    entries = []
    ordered: list[tuple[str, int | None]] = [(image.name, index) for index, image in enumerate(images)]
    ordered += [(path.relative_to(image_folder).as_posix(), None) for path in unregistered]
    for order, (name, index) in enumerate(sorted(ordered, key=lambda item: natural_key(item[0]))):
        time = order / parameters.frame_rate
        if index is None:
            files = FrameFiles(image_folder / name)
            entries.append(Entry(name, time, None, _never, "missing_pose", chosen[0], files))
        elif group_of[index].name in chosen:
            group = group_of[index]
            form = FrameFormat(recorded[index], group.camera, has_color, has_depth, stored, pictures[group.name])
            files = FrameFiles(colors[index], depths[index])
            pose = images[index].world_from_camera
            problem = "non_rigid_pose" if pose is None else None
            entries.append(Entry(name, time, pose, frame_loader(files, form), problem, group_of[index].name, files))
    lenses = [camera.lens.words for camera in dict.fromkeys(recorded) if not camera.lens.is_pinhole]
    notes = (
        *model_notes,
        *notes_of_options,
        *group_notes,
        *(
            (f"lens distortion undone ({lenses[0] if len(lenses) == 1 else f'{len(lenses)} lenses'})",)
            if lenses
            else ()
        ),
        *((f"{len(unregistered)} images are not registered in the model",) if unregistered else ()),
        *_scale_notes(depth_words, unit_note),
        f"times assumed: order of the names / {parameters.frame_rate:g} per second",
    )
    streams = [stream(image_folder.name, "color", [*colors, *unregistered])] if has_color else []
    if has_depth:
        streams.append(stream(str(depth_words), "depth", [path for path in depths if path]))
    streams.append(text_stream(model.folder.name, "pose", len(images)))
    return LogSource(
        "colmap",
        rule,
        tuple(
            SourceCamera(group.name, group.camera, picture=picture_camera(group.camera, pictures[group.name]))
            for group in _in_order(groups, chosen)
        ),
        tuple(entries),
        notes,
        streams=tuple(streams),
        damage=damage,
        other_cameras=tuple(name for name in counts if name not in chosen),
    )


def _in_order(groups: tuple[CameraGroup, ...], chosen: tuple[str, ...]) -> list[CameraGroup]:
    by_name = {group.name: group for group in groups}
    return [by_name[name] for name in chosen]


def _never() -> LoadedFrame:
    raise Unusable("missing_pose")


def _model_folders(root: Path) -> list[Path]:
    """Return the folders with a model: sparse/0, sparse/1, ..., sparse, the folder itself."""
    candidates = []
    for name in ("sparse", "colmap/sparse"):
        if (root / name).is_dir():
            below = (folder for folder in (root / name).iterdir() if folder.is_dir())
            candidates += sorted(below, key=lambda folder: natural_key(folder.name))
            candidates.append(root / name)
    return [folder for folder in (*candidates, root) if has_model(folder)]


def _largest_model(root: Path, parameters: IngestParameters) -> tuple[SparseModel, list[str], tuple[str, ...]]:
    """Return the model with most images, notes, and what is wrong with other models. Raises BadInput without any."""
    folders = _model_folders(root)
    if not folders:
        raise BadInput(f"{root}: there is no sparse model with cameras and images", hint="run COLMAP's mapper first")
    models, damage = [], []
    for folder in folders:
        try:
            models.append(read_model(folder))
        except BadInput as error:
            damage.append(str(error))
            if parameters.damage == "refuse" or len(damage) == len(folders):
                raise
    largest = max(models, key=lambda model: len(model.images))
    folder_name = largest.folder.relative_to(root).as_posix()
    notes = [
        f"poses and intrinsics from {'the folder' if folder_name == '.' else folder_name}: {len(largest.images)} images"
    ]
    if len(models) > 1:
        listed = ", ".join(f"{model.folder.relative_to(root).as_posix()} {len(model.images)}" for model in models)
        notes.append(f"largest of {len(models)} models taken ({listed}); they do not share a world")
    return largest, notes, tuple(damage)


def _depths(root: Path, images: list[ModelImage]) -> tuple[list[Path | None], str | None]:
    """Return the depth of each image, and the folder it is from (None: there is none)."""
    if (root / "depth").is_dir():
        paths = [_find_file_like(root / "depth", image.name, root) for image in images]
        return paths, "depth" if any(paths) else None
    dense_maps: list[Path | None] = []
    for image in images:
        candidates = (named_file(root / DENSE_MAPS, image.name + ending, str(root)) for ending in DENSE_ENDINGS)
        dense_maps.append(next((path for path in candidates if path.is_file()), None))
    return dense_maps, DENSE_MAPS if any(dense_maps) else None


def _find_file_like(folder: Path, name: str, root: Path) -> Path | None:
    stem = name.rsplit(".", 1)[0] if "." in Path(name).name else name
    endings = (*DEPTH_SUFFIXES, ".npy", ".exr")
    candidates = (named_file(folder, stem + ending, str(root)) for ending in endings)
    return next((path for path in candidates if path.is_file()), None)


def _recorded_cameras(
    model: SparseModel,
    images: list[ModelImage],
    colors: list[Path],
    depths: list[Path | None],
    parameters: IngestParameters,
) -> tuple[list[RecordedCamera], tuple[str, ...]]:
    """Return the camera of each image at the size of its depth, or of its colour where there is none."""
    cameras: dict[int, RecordedCamera] = {}
    notes: tuple[str, ...] = ()
    for number in dict.fromkeys(image.camera for image in images):
        of_camera = [index for index, image in enumerate(images) if image.camera == number]
        where = f"{model.folder}: camera {number}"
        size = depth_image_size(path for index in of_camera if (path := depths[index]) is not None)
        size = size or color_image_size((colors[index] for index in of_camera), model.cameras[number].size)
        camera = _camera(model.cameras[number], where).at(size, where)
        cameras[number], notes = overridden_recording(camera, parameters)
    return [cameras[image.camera] for image in images], notes


def _camera(camera: ModelCamera, where: str) -> RecordedCamera:
    """Return the camera with pixel centres at integers. Raises BadInput for models that OpenCV has not."""
    values, fisheye = camera.parameters, "FISHEYE" in camera.model
    if camera.model in ONE_FOCAL_LENGTH:
        numbers, coefficients = (values[0], values[0], values[1], values[2]), values[3:]
        # k1 and k2 alone; OpenCV's list goes on with the tangential p1 and p2.
        coefficients = (*coefficients, *(0.0,) * (4 - len(coefficients)))
    elif camera.model in TWO_FOCAL_LENGTHS:
        numbers, coefficients = (values[0], values[1], values[2], values[3]), values[4:]
    else:
        raise BadInput(
            f"{where}: is of model {camera.model!r:.40}, which is not undistorted here",
            hint="run COLMAP's image_undistorter and give its output folder",
        )
    lens = lens_of(coefficients, where, fisheye=fisheye)
    numbers = (numbers[0], numbers[1], numbers[2] - 0.5, numbers[3] - 0.5)
    return RecordedCamera(pinhole(numbers, camera.size, where), PINHOLE if lens.is_pinhole else lens)


def _unregistered_images(folder: Path, registered: list[Path]) -> list[Path]:
    in_model = set(registered)
    images = (path for path in folder.rglob("*") if path.suffix.lower() in COLOR_SUFFIXES and path.is_file())
    return [path for path in images if path not in in_model] if folder.name in IMAGE_FOLDERS else []


def _scale_notes(depth_words: str | None, unit_note: str) -> tuple[str, ...]:
    if depth_words is None:
        return ("WARNING: scale unknown: COLMAP's world has no unit, one of it is taken as a metre",)
    if depth_words == DENSE_MAPS:
        return (
            f"WARNING: scale unknown: COLMAP's world and depth ({depth_words}) have no unit, one is taken as a metre",
        )
    return (unit_note, "scale of the poses assumed: that of the depth images")
