"""How the images of one camera become frames of one pinhole camera: lenses, registration of depth, rectified pairs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.folders.files import camera_from_options, overridden
from scenewright.stages.ingest.lenses import Lens, check_calibrated, is_calibrated, lens_of, same_rays
from scenewright.stages.ingest.messages.cameras import CameraTopics, calibration_of, calibration_topic, fixed_transform
from scenewright.stages.ingest.messages.records import CalibrationRecord
from scenewright.stages.ingest.messages.survey import LogContent
from scenewright.stages.ingest.messages.topic_names import is_rectified, is_registered
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.stereo import UNCLEAR, in_metres, projected_baseline, stereo_lenses
from scenewright.stages.kit.geometry.transforms import transform_from

SAME_PLACE = 1e-6
"""Largest difference of two 4 x 4 motions that are called equal [m, 1]; rounding."""


@dataclass(frozen=True)
class CameraGeometry:
    """What loading a frame needs to know besides its images."""

    camera: Camera
    """Of the frames."""
    frame: str
    """Frame of the log whose pose is asked for."""
    frame_from_camera: np.ndarray
    """(4, 4): how `camera` stands in `frame`; a rotation for rectified pairs, else the identity."""
    color: Lens | None = None
    depth: Lens | None = None
    right: Lens | None = None
    baseline: float | None = None
    """[m]"""
    target_from_depth: np.ndarray | None = None
    """(4, 4) from the depth camera to `camera`, when depth has to be carried there; None: pixels stay in place."""
    registered: bool = True
    """Whether colour and depth pixels see the same ray."""
    notes: tuple[str, ...] = field(default=())


def geometry_of(topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str) -> CameraGeometry:
    """Return how the topics of a camera fit together.

    Depth of another camera than the colour is carried into the colour camera when the log says how the two stand to
    each other. Raises BadInput when intrinsics are missing or impossible, and for pairs that are none.
    """
    if all(getattr(parameters, name) is not None for name in ("fx", "fy", "cx", "cy")):
        return _geometry_by_options(topics, content, parameters, where)
    if topics.right is not None:
        geometry = _with_right(topics, content, parameters, where)
    elif topics.color is None or topics.depth is None:
        geometry = _single(topics, content, parameters, where)
    else:
        geometry = _color_and_depth(topics, content, parameters, where)
    camera, notes_of_options = overridden(geometry.camera, parameters)
    return replace(geometry, camera=camera, notes=(*geometry.notes, *notes_of_options))


def _geometry_by_options(
    topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str
) -> CameraGeometry:
    """All intrinsics are given: images are taken as they are."""
    main = content.images[topics.depth or topics.main]
    size = main.size if main.size != (0, 0) else content.images[topics.main].size
    camera = camera_from_options(size, parameters, f"{where}: no camera calibration")
    if topics.right is not None:
        raise BadInput(
            f"{where}: a stereo pair needs the calibration of the log, not intrinsics given by option",
            hint="leave out --fx --fy --cx --cy",
        )
    registered, notes = True, ["intrinsics given by option"]
    color = None
    if topics.color is not None:
        images = content.images[topics.color]
        color = Lens(_resized(camera, images.size), images.size)
        if topics.depth is not None and not _pixels_agree(topics, content):
            registered = False
            notes.append(_apart(topics, content))
    depth = None if topics.depth is None else Lens(camera, main.size)
    return CameraGeometry(camera, main.frame_id, np.eye(4), color, depth, registered=registered, notes=tuple(notes))


def _resized(camera: Camera, size: tuple[int, int]) -> Camera:
    return camera.model_copy(update={"width": size[0], "height": size[1]}) if size != (0, 0) else camera


def _lens(topic: str, content: LogContent, image_kind: str, parameters: IngestParameters, where: str) -> Lens:
    """Return the lens of a topic by its own calibration. Raises BadInput when there is none."""
    name = calibration_topic(topic, content)
    size = content.images[topic].size
    if name is None:
        zeros = [topic_name for topic_name, record in sorted(content.calibrations.items()) if not is_calibrated(record)]
        if zeros:
            check_calibrated(content.calibrations[zeros[0]], f"{where}: topic {zeros[0]}")
        why = f"{where}: no camera calibration for {topic}{content.undecodable_calibrations()}"
        return Lens(camera_from_options(size, parameters, why), size)
    lens = lens_of(content.calibrations[name], size, is_rectified(topic), f"{where}: topic {name}", image_kind)
    notes = [f"intrinsics of {topic} from topic {name}", *lens.notes]
    if name in content.changed_calibrations:
        notes.append(f"the calibration {name} changes within the log; the first one is used")
    return Lens(lens.camera, lens.size, lens.maps, lens.camera_from_frame, tuple(notes))


def _single(topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str) -> CameraGeometry:
    image_kind = "colour images" if topics.color else "depth images"
    lens = _lens(topics.main, content, image_kind, parameters, where)
    frame = content.images[topics.main].frame_id
    color, depth = (lens, None) if topics.color else (None, lens)
    return CameraGeometry(lens.camera, frame, np.eye(4), color, depth, notes=lens.notes)


def _color_and_depth(
    topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str
) -> CameraGeometry:
    assert topics.color is not None and topics.depth is not None
    agree = _pixels_agree(topics, content)
    calibrations = _own_of_color(topics, content), calibration_of(topics.depth, content)
    if calibrations[1] is None and not (agree and calibrations[0] is not None):
        _lens(topics.depth, content, "depth images", parameters, where)  # asks for the intrinsics
    if calibrations[1] is None:
        depth = _as_color(topics, content, where)
    else:
        depth = _lens(topics.depth, content, "depth images", parameters, where)
    if calibrations[0] is None:
        return _uncalibrated_color(topics, content, depth, agree)
    color = _lens(topics.color, content, "colour images", parameters, where)
    notes = tuple(dict.fromkeys((*depth.notes, *color.notes)))
    frames = content.images[topics.color].frame_id, content.images[topics.depth].frame_id
    offset = np.eye(4) if agree else fixed_transform(frames[0], frames[1], content)
    if offset is None:
        return _apart_geometry(topics, content, depth, color, notes, "nothing says how the two stand to each other")
    if np.abs(offset - np.eye(4)).max() < SAME_PLACE and same_rays(color.camera, depth.camera):
        return CameraGeometry(depth.camera, frames[1], np.eye(4), color, depth, notes=notes)
    if not parameters.register_depth:
        return _apart_geometry(topics, content, depth, color, notes, "registration was not wanted")
    distance = np.linalg.norm(offset[:3, 3])
    note = f"depth carried into the colour camera, {1000 * distance:.1f} mm from it ({frames[0]!r} from {frames[1]!r})"
    return CameraGeometry(
        color.camera, frames[0], np.eye(4), color, depth, target_from_depth=offset, notes=(*notes, note)
    )


def _own_of_color(topics: CameraTopics, content: LogContent) -> CalibrationRecord | None:
    """Return the calibration of the colour images, None when it is that of depth images of another shape."""
    assert topics.color is not None and topics.depth is not None
    record, (width, height) = calibration_of(topics.color, content), content.images[topics.color].size
    if record is None or record is not calibration_of(topics.depth, content):
        return record
    return record if abs(record.width * height - record.height * width) <= max(record.width, record.height) else None


def _pixels_agree(topics: CameraTopics, content: LogContent) -> bool:
    """Whether colour and depth are of one frame, by what the log says: the same name, or an identity between them, or
    a topic that promises it."""
    assert topics.color is not None and topics.depth is not None
    frames = content.images[topics.color].frame_id, content.images[topics.depth].frame_id
    if frames[0] == frames[1]:
        return True
    offset = fixed_transform(frames[0], frames[1], content)
    if offset is not None:
        return bool(np.abs(offset - np.eye(4)).max() < SAME_PLACE)
    return is_registered(topics.depth)


def _as_color(topics: CameraTopics, content: LogContent, where: str) -> Lens:
    """Return the lens of depth images by the calibration of the colour images that they are registered to."""
    assert topics.color is not None and topics.depth is not None
    name = calibration_topic(topics.color, content)
    assert name is not None
    size = content.images[topics.depth].size
    record = content.calibrations[name]
    lens = lens_of(record, size, is_rectified(topics.color), f"{where}: topic {name}", "depth images")
    notes = (f"intrinsics of {topics.depth} from topic {name}, as it is registered to {topics.color}", *lens.notes)
    return Lens(lens.camera, lens.size, lens.maps, lens.camera_from_frame, notes)


def _uncalibrated_color(topics: CameraTopics, content: LogContent, depth: Lens, agree: bool) -> CameraGeometry:
    """Colour without a calibration of its own is that of the depth camera when they are of one frame."""
    assert topics.color is not None and topics.depth is not None
    size = content.images[topics.color].size
    if not agree:
        color = Lens(_resized(depth.camera, size), size)
        why = f"{topics.color} has no calibration"
        return _apart_geometry(topics, content, depth, color, depth.notes, why)
    # Resized first, as the maps are for the size of the depth images.
    color = Lens(depth.camera, depth.size, depth.maps)
    return CameraGeometry(
        depth.camera, content.images[topics.depth].frame_id, np.eye(4), color, depth, notes=depth.notes
    )


def _apart_geometry(
    topics: CameraTopics, content: LogContent, depth: Lens, color: Lens, notes: tuple[str, ...], why: str
) -> CameraGeometry:
    """Colour and depth are not registered: frames are those of the depth camera, with colour where its shape fits."""
    assert topics.depth is not None
    frame = content.images[topics.depth].frame_id
    width, height = color.size
    fits = abs(width * depth.camera.height - height * depth.camera.width) <= max(
        depth.camera.width, depth.camera.height
    )
    note = f"WARNING: {_apart(topics, content)}: {why}"
    if fits:
        return CameraGeometry(depth.camera, frame, np.eye(4), color, depth, registered=False, notes=(*notes, note))
    note += f"; colour ({width}x{height}) left out, as it is of another shape"
    return CameraGeometry(depth.camera, frame, np.eye(4), None, depth, notes=(*notes, note))


def _apart(topics: CameraTopics, content: LogContent) -> str:
    assert topics.color is not None and topics.depth is not None
    frames = content.images[topics.color].frame_id, content.images[topics.depth].frame_id
    return f"colour ({frames[0]!r}) and depth ({frames[1]!r}) are different frames and not registered"


def _with_right(topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str) -> CameraGeometry:
    if topics.color is None or topics.right is None:
        raise BadInput(f"{where}: no left images for {topics.right}", hint="a pair needs the images of both")
    names = topics.color, topics.right
    calibrations = tuple(_needed_calibration(name, content, where) for name in names)
    sizes = tuple(content.images[name].size for name in names)
    frames = tuple(content.images[name].frame_id for name in names)
    left, right, baseline = stereo_lenses(
        (calibrations[0], calibrations[1]),
        (sizes[0], sizes[1]),
        (is_rectified(names[0]), is_rectified(names[1])),
        None if frames[0] == frames[1] else fixed_transform(frames[0], frames[1], content),
        names,
        where,
        parameters.baseline,
    )
    unit: tuple[str, ...] = ()
    if parameters.baseline is None and projected_baseline(*calibrations) and abs(baseline) >= UNCLEAR[0]:
        baseline, note = in_metres(baseline, where)  # transforms are in metres, projections of whoever calibrated
        unit = (note,) if note else ()
    turn = np.eye(3) if left.camera_from_frame is None else left.camera_from_frame
    frame_from_camera = transform_from(turn.T, np.zeros(3))
    notes = (*left.notes, *right.notes, *unit, f"stereo pair {names[0]} and {names[1]}, {abs(baseline):.4g} m apart")
    geometry = CameraGeometry(
        left.camera, frames[0], frame_from_camera, left, None, right, baseline, notes=tuple(dict.fromkeys(notes))
    )
    if topics.depth is None:
        return geometry
    return _with_depth(geometry, topics, content, parameters, where)


def _needed_calibration(topic: str, content: LogContent, where: str) -> CalibrationRecord:
    record = calibration_of(topic, content)
    if record is None:
        raise BadInput(
            f"{where}: no camera calibration for {topic}, and a stereo pair needs both",
            hint="record the CameraInfo of both, or choose one with --camera or --color-topic",
        )
    return record


def _with_depth(
    geometry: CameraGeometry, topics: CameraTopics, content: LogContent, parameters: IngestParameters, where: str
) -> CameraGeometry:
    """Add depth to a stereo pair: carried into the rectified left eye, or left out when that cannot be."""
    assert topics.color is not None and topics.depth is not None
    frames = content.images[topics.color].frame_id, content.images[topics.depth].frame_id
    depth_record = calibration_of(topics.depth, content)
    offset = np.eye(4) if _pixels_agree(topics, content) else fixed_transform(frames[0], frames[1], content)
    if offset is None or depth_record is None:
        note = f"WARNING: depth of {topics.depth} left out: nothing says how it stands to {topics.color}"
        return replace(geometry, notes=(*geometry.notes, note))
    depth = _lens(topics.depth, content, "depth images", parameters, where)
    target_from_depth = geometry.frame_from_camera.T @ offset
    same = np.abs(target_from_depth - np.eye(4)).max() < SAME_PLACE and same_rays(geometry.camera, depth.camera)
    if same and (depth.camera.width, depth.camera.height) == (geometry.camera.width, geometry.camera.height):
        return replace(geometry, depth=depth, notes=(*geometry.notes, *depth.notes))
    if not parameters.register_depth:
        note = (
            f"WARNING: depth of {topics.depth} left out: it is not that of the left eye, and was not to be registered"
        )
        return replace(geometry, notes=(*geometry.notes, note))
    return replace(geometry, depth=depth, target_from_depth=target_from_depth, notes=(*geometry.notes, *depth.notes))
