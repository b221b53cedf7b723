"""TUM RGB-D folders: rgb.txt and depth.txt name stamped images, groundtruth.txt the poses; ICL-NUIM in that form too.

Colour and depth of the data set are registered one to one in the colour camera's picture as it was taken, so both have
its lens distortion, which is undone in both (depth takes the nearest pixel); the ground truth is the pose of that
camera. The data set's page offers 525 525 319.5 239.5 without any undistortion as a simpler choice: giving these four
by option does that.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.association import mutual_nearest
from scenewright.stages.ingest.clocks import in_file_order, order_note, stamps_problem
from scenewright.stages.ingest.folders.calibration_files import read_calibration
from scenewright.stages.ingest.folders.calibration_search import calibration_of, refuse_several
from scenewright.stages.ingest.folders.depth_units import settled_units
from scenewright.stages.ingest.folders.exr_depth import require_exr
from scenewright.stages.ingest.folders.files import (
    all_intrinsics_given,
    camera_from_options,
    color_image_size,
    depth_form,
    depth_image_size,
    named_file,
    pinhole,
    stream,
    text_stream,
)
from scenewright.stages.ingest.folders.frame_loading import FrameFormat, frame_loader
from scenewright.stages.ingest.folders.stamped_poses import StampedPoses, coverage_notes, read_stamped_poses, scaled
from scenewright.stages.ingest.folders.undistortion import (
    RecordedCamera,
    lens_of,
    overridden_recording,
    recorded_camera,
)
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, FrameFiles, LogSource, Role, SourceCamera
from scenewright.stages.kit.formats.stamps import exact_stamps
from scenewright.stages.kit.formats.trajectories import read_text

COLOR_LIST, DEPTH_LIST = "rgb.txt", "depth.txt"
ASSOCIATIONS = ("associated.txt", "associations.txt", "association.txt", "associate.txt")
CALIBRATIONS = ("calibration.txt", "camera.txt", "intrinsics.txt")
UNITS_PER_METRE = 5000.0
"""Stored depth per metre in TUM's and ICL-NUIM's folders, as both data sets state it."""
FREIBURG = {
    "1": ((517.3, 516.5, 318.6, 255.3), (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    "2": ((520.9, 521.0, 325.1, 249.7), (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    "3": ((535.4, 539.2, 320.1, 247.6), ()),
}
"""Colour cameras of the data set at 640x480 as its page states them: fx fy cx cy; k1 k2 p1 p2 k3."""
FREIBURG_NAME = re.compile(r"(?:freiburg|(?<![a-z])fr)([123])(?!\d)")
ICL_NUIM = (481.2, 480.0, 319.5, 239.5)
"""Intrinsics fx, fy, cx, cy [px] of ICL-NUIM for 640 x 480, as the data set states them."""
ICL_NUIM_NAME = re.compile(r"icl[-_ ]?nuim|(?:living_?room|office)_?traj\d|(?<![a-z])(?:lr|of)_?kt\d")
D435_FOCAL, KINECT_FOCAL = 615 / 480, 525 / 480
"""Focal length of the colour cameras that most such folders are of, in heights of the picture."""
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
"""Mirrors y, before and after a pose: ICL-NUIM's camera has its y axis the other way round."""


@dataclass(frozen=True)
class _Stamped:
    """The images that a list names."""

    stamps: np.ndarray
    """(N,) int64 [ns], in file order."""
    paths: tuple[Path, ...]
    note: str = ""
    """What the stamps were taken for, for people."""


def matches(root: Path) -> str | None:
    """Return the rule that matched, or None."""
    if not root.is_dir():
        return None
    if (root / COLOR_LIST).is_file():
        depth_words = f" and {DEPTH_LIST}" if (root / DEPTH_LIST).is_file() else ", no depth"
        return f"folder with {COLOR_LIST}{depth_words}: TUM RGB-D"
    pairs = next((name for name in ASSOCIATIONS if (root / name).is_file()), None)
    if pairs is None and (root / DEPTH_LIST).is_file():
        return f"folder with {DEPTH_LIST}, no colour: TUM RGB-D"
    return f"folder with {pairs}: TUM RGB-D" if pairs else None


def open_source(root: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """List the frames of a TUM RGB-D folder. Raises BadInput for damaged lists, poses or unknown intrinsics."""
    icl_nuim = _is_icl_nuim(root)
    # ICL-NUIM numbers its frames where TUM has stamps.
    unit = 1 / parameters.frame_rate if icl_nuim else 1.0
    colors, depths = _images(root, unit)
    require_exr(path.name for path in depths.paths)
    listed: list[tuple[str, Role, _Stamped]] = [("rgb", "color", colors), ("depth", "depth", depths)]
    poses = _poses(root, unit)
    size = depth_image_size(depths.paths) if depths.paths else color_image_size(colors.paths)
    recorded, stated, notes = _camera(root, size, parameters, icl_nuim)
    recorded, notes_of_options = overridden_recording(recorded, parameters)
    freiburg = FREIBURG_NAME.search(root.resolve().name.lower()) is not None
    known = poses is not None or stated is not None or icl_nuim or freiburg
    units, doubt = (UNITS_PER_METRE, "") if known else settled_units(UNITS_PER_METRE, depths.paths, parameters)
    stored, unit_note = depth_form(parameters, units, depths.paths, stated)
    form = FrameFormat(recorded, recorded.camera, bool(colors.paths), bool(depths.paths), stored)
    colors, depths, partners, no_clock = _paired(root, colors, depths, parameters, poses is not None)
    main_list = colors if colors.paths else depths
    entries = []
    for stamp, path, partner in zip(main_list.stamps, main_list.paths, partners, strict=True):
        missing = bool(depths.paths) and partner < 0
        depth = depths.paths[partner] if partner >= 0 else None
        # The shape of the scene comes from the depth image, so its time is that of the frame.
        moment = int(depths.stamps[partner] if partner >= 0 else stamp)
        pose = poses.at(moment, parameters) if poses else None
        if pose is not None and icl_nuim:
            pose = MIRROR @ pose @ MIRROR
        problem = "no_depth_within_tolerance" if missing else None
        files = FrameFiles(path if colors.paths else None, depth)
        own_stamp = None if icl_nuim or no_clock is not None else int(stamp)
        entries.append(
            Entry(
                str(path.relative_to(root)),
                moment * 1e-9,
                pose,
                frame_loader(files, form),
                problem,
                files=files,
                stamp=own_stamp,
            )
        )
    posed = [entry.world_from_camera is not None for entry in entries]
    covered = coverage_notes(poses, [round(entry.time * 1e9) for entry in entries], posed, parameters) if poses else ()
    unpaired = len(depths.paths) - int((partners >= 0).sum())
    notes = (
        *notes,
        *notes_of_options,
        *((unit_note,) if depths.paths else ()),
        *((doubt,) if doubt else ()),
        *((order_note(no_clock, parameters),) if no_clock is not None else ()),
        *dict.fromkeys(f"images: {images.note}" for _, _, images in listed if images.note and no_clock is None),
        *(poses.notes if poses else ()),
        *covered,
        *((f"{unpaired} depth images are paired with no colour image",) if unpaired else ()),
        *(_icl_notes(parameters) if icl_nuim else ()),
    )
    streams = [stream(name, role, images.paths, images.stamps) for name, role, images in listed if images.paths]
    if poses:
        streams.append(text_stream("groundtruth.txt", "pose", len(poses.stamps), poses.stamps))
    camera = SourceCamera("camera", recorded.camera)
    missing = {} if any(posed) or not covered else {"pose": "; ".join(covered).removeprefix("WARNING: ")}
    return LogSource("tum", rule, (camera,), tuple(entries), notes, streams=tuple(streams), missing=missing)


def _images(root: Path, unit: float) -> tuple[_Stamped, _Stamped]:
    """Return the colour and depth images; a list in which stamp and name alternate serves where the two are missing."""
    path = next((root / name for name in ASSOCIATIONS if (root / name).is_file()), None)
    if path is None or (root / COLOR_LIST).is_file():
        colors, depths = (
            _read_list(root, name, unit) if (root / name).is_file() else _Stamped(np.zeros(0, np.int64), ())
            for name in (COLOR_LIST, DEPTH_LIST)
        )
        return colors, depths
    columns: tuple[list[tuple[str, str, str]], ...] = ([], [])
    for where, fields in _rows(path):
        if len(fields) != 4:
            raise BadInput(f"{where}: {len(fields)} columns, expected stamp, name, stamp, name", hint="correct it")
        pairs = [(fields[0], fields[1]), (fields[2], fields[3])]
        if "depth" in fields[1].split("/")[0] and "depth" not in fields[3].split("/")[0]:
            pairs.reverse()  # ICL-NUIM lists depth first
        for column, (stamp, name) in zip(columns, pairs, strict=True):
            column.append((where, stamp, name))
    return _stamped(root, columns[0], unit), _stamped(root, columns[1], unit)


def _read_list(root: Path, name: str, unit: float) -> _Stamped:
    rows = []
    for where, fields in _rows(root / name, maximum_splits=1):
        if len(fields) != 2:
            raise BadInput(f"{where}: expected a time stamp and a file name", hint="correct it")
        rows.append((where, fields[0], fields[1].strip()))
    return _stamped(root, rows, unit)


def _stamped(root: Path, rows: list[tuple[str, str, str]], unit: float) -> _Stamped:
    """Return the images of rows (place, stamp, name)."""
    column = exact_stamps([stamp for _, stamp, _ in rows], [where for where, _, _ in rows])
    stamps = [scaled(stamp, unit) for stamp in column.stamps if stamp is not None]
    return _Stamped(
        np.array(stamps, np.int64), tuple(named_file(root, name, where) for where, _, name in rows), column.note
    )


def _rows(path: Path, maximum_splits: int = -1) -> list[tuple[str, list[str]]]:
    """Return (place, fields) of every line; blank lines and # comments are skipped."""
    lines = enumerate(read_text(path).splitlines(), start=1)
    return [
        (f"{path}: line {number}", line.split(None, maximum_splits))
        for number, line in lines
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _paired(
    root: Path, colors: _Stamped, depths: _Stamped, parameters: IngestParameters, has_poses: bool
) -> tuple[_Stamped, _Stamped, np.ndarray, str | None]:
    """Return colour and depth in time order, for each image of the main list (N,) the index of its depth or -1, and why
    their stamps are no clock's.

    Such stamps say nothing: images are then paired by their order in the file. Poses with stamps are looked up by
    them, right or wrong. Raises BadInput when lists of two lengths are to be paired by order.
    """
    problems = (stamps_problem(each.stamps.tolist(), [path.name for path in each.paths]) for each in (colors, depths))
    problem = None if has_poses else next((found for found in problems if found is not None), None)
    if problem is None:
        colors, depths = _by_time(colors), _by_time(depths)
        tolerance = round(parameters.maximum_time_difference * 1e9)
        main_list = colors if colors.paths else depths
        return colors, depths, mutual_nearest(main_list.stamps, depths.stamps, tolerance), None
    counts = len(colors.paths), len(depths.paths)
    if all(counts) and counts[0] != counts[1]:
        raise BadInput(
            f"{root}: {problem}, and {counts[0]} images and {counts[1]} depth images have no common order",
            hint=f"put {ASSOCIATIONS[1]} in the place of {COLOR_LIST}: a line `number image number depth` a frame",
        )
    stamps = in_file_order(max(counts), parameters.frame_rate)
    colors, depths = (replace(each, stamps=stamps[: len(each.paths)]) for each in (colors, depths))
    return colors, depths, np.arange(max(counts)) if counts[1] else np.full(counts[0], -1), problem


def _by_time(images: _Stamped) -> _Stamped:
    order = np.argsort(images.stamps, kind="stable")
    return replace(images, stamps=images.stamps[order], paths=tuple(images.paths[i] for i in order))


def _poses(root: Path, unit: float) -> StampedPoses | None:
    names = ["groundtruth.txt", *sorted(path.name for path in root.glob("*.gt.freiburg"))]
    path = next((root / name for name in names if (root / name).is_file()), None)
    return read_stamped_poses(path, unit) if path else None


def _is_icl_nuim(root: Path) -> bool:
    """Whether the folder is of the ICL-NUIM data set: rendered, with frame numbers for stamps."""
    return any(root.glob("*.gt.freiburg")) or bool(ICL_NUIM_NAME.search(root.resolve().name.lower()))


def _icl_notes(parameters: IngestParameters) -> tuple[str, ...]:
    return (
        f"times assumed: ICL-NUIM frame number / {parameters.frame_rate:g} per second",
        "ICL-NUIM poses mirrored in y: they are those of a renderer with y up (hence its negative fy), its images are "
        "stored from the top down",
    )


def _camera(
    root: Path, size: tuple[int, int] | None, parameters: IngestParameters, icl_nuim: bool
) -> tuple[RecordedCamera, float | None, tuple[str, ...]]:
    """Return the colour camera, from a file, else the data set's own by the folder's name, else from options; and the
    stored depth per metre where the file states it."""
    given = all_intrinsics_given(parameters)  # what files say of the camera does not count then
    path = None if given else next((root / name for name in CALIBRATIONS if (root / name).is_file()), None)
    if path is not None:
        return _read_calibration(path, size), None, (f"intrinsics read from {path.name}",)
    path = None if given else calibration_of(root)
    if path is not None:
        calibration = read_calibration(path)
        return recorded_camera(calibration.left, size, str(path)), calibration.depth_units, calibration.notes
    standard = size in (None, (640, 480))
    if icl_nuim and standard:
        return (
            RecordedCamera(pinhole(ICL_NUIM, size, str(root))),
            None,
            ("intrinsics assumed: ICL-NUIM, 481.2 480 319.5 239.5",),
        )
    match = FREIBURG_NAME.search(root.resolve().name.lower())
    if match and standard:
        numbers, coefficients = FREIBURG[match[1]]
        listed = " ".join(f"{value:g}" for value in numbers)
        recorded = RecordedCamera(pinhole(numbers, size, str(root)), lens_of(coefficients, str(root)))
        undone = ", lens distortion undone in colour and depth" if coefficients else ""
        return recorded, None, (f"intrinsics assumed: freiburg{match[1]} colour camera, {listed}{undone}",)
    if given:
        return RecordedCamera(camera_from_options(size, parameters, str(root))), None, ()
    refuse_several(root)
    shape = f"images are {size[0]}x{size[1]}" if size else "no image can be decoded"
    raise BadInput(
        f"{root}: intrinsics are not known: there is no {CALIBRATIONS[0]}, and the folder's name and images ({shape}) "
        "are not those of freiburg1, 2 or 3",
        hint=f"give --fx --fy --cx --cy{_usual_intrinsics(size)}",
    )


def _usual_intrinsics(size: tuple[int, int] | None) -> str:
    """Return what to try where the camera can't be asked."""
    if size is None:
        return ""
    width, height = size
    return (
        " as the camera's driver states them; where nobody knows them, those of a RealSense D435 are about "
        f"--fx {D435_FOCAL * height:.4g} --fy {D435_FOCAL * height:.4g} --cx {width / 2:g} --cy {height / 2:g}, "
        f"of a Kinect --fx {KINECT_FOCAL * height:.4g} --fy {KINECT_FOCAL * height:.4g}"
    )


def _read_calibration(path: Path, size: tuple[int, int] | None) -> RecordedCamera:
    """Return the camera in a text file with fx fy cx cy, and distortion coefficients or none."""
    fields = [field for _, row in _rows(path) for field in row]
    try:
        numbers = [float(field) for field in fields]
    except ValueError:
        raise BadInput(f"{path}: expected the numbers fx fy cx cy [k1 k2 p1 p2 [k3]]", hint="correct it") from None
    if len(numbers) not in (4, 8, 9):
        raise BadInput(f"{path}: {len(numbers)} numbers, expected fx fy cx cy [k1 k2 p1 p2 [k3]]", hint="correct it")
    return RecordedCamera(pinhole(numbers[:4], size, str(path)), lens_of(numbers[4:], str(path)))
