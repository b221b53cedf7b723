"""The frames of one camera: which images and which pose belong together, and loading them one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.association import fresh, partners
from scenewright.stages.ingest.depth_registration import registered_depth
from scenewright.stages.ingest.images import DepthForm, depth_millimetres, fitted_color
from scenewright.stages.ingest.lenses import Lens
from scenewright.stages.ingest.messages.camera_geometry import CameraGeometry
from scenewright.stages.ingest.messages.cameras import CameraTopics
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.decoding import decoder_for
from scenewright.stages.ingest.messages.pixels import color_pixels, depth_pixels, depth_unit, label_pixels
from scenewright.stages.ingest.messages.pose_source import PoseSource
from scenewright.stages.ingest.messages.records import ImageRecord, Undecodable
from scenewright.stages.ingest.messages.survey import LogContent
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, LoadedFrame, Unusable
from scenewright.stages.kit.formats.foxglove import decode_color
from scenewright.stages.kit.formats.image_headers import image_size

NO_PARTNER = "no_{}_within_tolerance"


def frame_entries(
    log: MessageLog,
    content: LogContent,
    topics: CameraTopics,
    geometry: CameraGeometry,
    poses: PoseSource | None,
    parameters: IngestParameters,
) -> tuple[list[Entry], list[str]]:
    """Return an entry for every colour image (of cameras without colour: every depth image), and notes.

    Depth, right eye and labels are the images nearest in time, each used once. The pose, and the time of the frame,
    is that of the depth image, of cameras without depth that of the colour image.
    """
    tolerance = round(parameters.maximum_time_difference * 1e9)
    with_color, with_depth = geometry.color is not None, geometry.depth is not None
    main = content.images[topics.main if with_color or topics.depth is None else topics.depth]
    stamps, first_of_stamp = main.stamps, fresh(main.stamps)
    topic_of: dict[str, str] = {}
    if with_color and with_depth and topics.depth is not None:
        topic_of["depth"] = topics.depth
    if geometry.right is not None and topics.right is not None:
        topic_of["right"] = topics.right
    if topics.labels is not None:
        topic_of["labels"] = topics.labels
    partner_of = {
        stream: partners(stamps, content.images[topic].stamps, tolerance) for stream, topic in topic_of.items()
    }
    needed = [stream for stream in ("depth", "right") if stream in topic_of and not (stream == "right" and with_depth)]
    entries: list[Entry] = []
    without_pose: list[int] = []
    for index in range(len(stamps)):
        places: dict[str, Hashable] = {"color" if with_color else "depth": main.locations[index]}
        stamp = own_stamp = int(stamps[index])
        name = f"{stamp * 1e-9:.6f} s"
        for stream, topic in topic_of.items():
            if partner_of[stream][index] >= 0:
                places[stream] = content.images[topic].locations[int(partner_of[stream][index])]
        missing = next((stream for stream in needed if stream not in places), None)
        if not first_of_stamp[index] or missing is not None:
            problem = NO_PARTNER.format(missing) if first_of_stamp[index] else "duplicate_stamp"
            entries.append(Entry(name, stamp * 1e-9, None, _never, problem, topics.name, stamp=own_stamp))
            continue
        if "depth" in topic_of:
            stamp = int(content.images[topic_of["depth"]].stamps[int(partner_of["depth"][index])])
        pose = None if poses is None else poses.at(geometry.frame, stamp)
        if pose is not None:
            pose = pose @ geometry.frame_from_camera
        elif poses is not None:
            without_pose.append(stamp)
        load = _loader(log, places, geometry, parameters)
        entries.append(Entry(name, stamp * 1e-9, pose, load, None, topics.name, stamp=own_stamp))
    notes = []
    if "depth" in topic_of:
        unused = len(content.images[topic_of["depth"]].stamps) - sum(entry.problem is None for entry in entries)
        if unused > 0:
            notes.append(f"{unused} depth images without a colour image of their own were left")
    if poses is not None and without_pose:
        gap = math.ceil(max(poses.gap_at(geometry.frame, stamp) for stamp in without_pose) / 1e7) / 100
        helps = f" (--maximum-transform-gap {gap:g} interpolates)" if gap * 1e9 > poses.gap else ""
        notes.append(
            f"{len(without_pose)} of {len(entries)} frames have no pose, the first at {without_pose[0] * 1e-9:.3f} s: "
            f"{poses.why_not(geometry.frame, without_pose[0])}{helps}"
        )
    return entries, notes


def depth_note(log: MessageLog, topic: str, content: LogContent, parameters: IngestParameters) -> str:
    """Return where the unit of depth comes from."""
    if parameters.depth_scale is not None:
        return f"depth unit given by option: 1/{parameters.depth_scale:g} m"
    images = content.images[topic]
    for location in images.locations[:1]:
        try:
            unit = depth_unit(_fetch_image(log, location, "depth"))
        except Unusable:
            break
        return f"depth in {'metres' if unit == 1 else 'millimetres'} ({images.encoding}, REP-118)"
    return f"depth in {images.encoding}"


def _never() -> LoadedFrame:
    raise Unusable("missing_partner")


def _fetch_image(log: MessageLog, location: Hashable, stream: str) -> ImageRecord:
    message = log.fetch(location)
    decode = decoder_for(message.channel)
    try:
        records = decode(message.data) if decode is not None else ()
    except Undecodable as problem:  # surveyed before, so the file changed meanwhile
        raise Unusable(f"undecodable_{stream}", str(problem)) from None
    for record in records:
        if isinstance(record, ImageRecord):
            return record
    raise Unusable(f"undecodable_{stream}", "no image")


def _loader(
    log: MessageLog, places: dict[str, Hashable], geometry: CameraGeometry, parameters: IngestParameters
) -> Callable[[], LoadedFrame]:
    def load() -> LoadedFrame:
        color = depth = right = labels = None
        if geometry.color is not None and "color" in places:
            color = picture(_fetch_image(log, places["color"], "color"), geometry.color, geometry.camera)
        if geometry.right is not None and "right" in places:
            right = picture(_fetch_image(log, places["right"], "right"), geometry.right, geometry.camera)
        if geometry.depth is not None and "depth" in places:
            depth = _depth(_fetch_image(log, places["depth"], "depth"), geometry, parameters)
        if "labels" in places:
            labels = _labels(_fetch_image(log, places["labels"], "labels"), geometry)
        return LoadedFrame(color, depth, labels, right)

    return load


def picture(record: ImageRecord, lens: Lens, camera: Camera) -> np.ndarray | bytes:
    """Return the picture of an image message as `camera` sees it: its own JPEG or PNG bytes where nothing is to be
    done, else (H, W, 3) uint8 RGB. Raises Unusable."""
    pixels_or_picture = color_pixels(record)
    if isinstance(pixels_or_picture, bytes):
        pixels = decode_color(pixels_or_picture)  # whole, or it would not be used
        if pixels is None:
            raise Unusable("undecodable_color", f"{len(pixels_or_picture)} bytes")
        if lens.maps is None and image_size(pixels_or_picture) == (camera.width, camera.height):
            return pixels_or_picture
        pixels_or_picture = pixels
    return fitted_color(lens.picture(pixels_or_picture), camera)


def _depth(record: ImageRecord, geometry: CameraGeometry, parameters: IngestParameters) -> np.ndarray:
    assert geometry.depth is not None
    lens = geometry.depth
    recorded = lens.camera.model_copy(update={"width": lens.size[0], "height": lens.size[1]})
    form = DepthForm(parameters.depth_scale or depth_unit(record), parameters.depth_bits)
    millimetres = depth_millimetres(depth_pixels(record), recorded, form)
    millimetres = lens.pixels(millimetres, "depth")
    if geometry.target_from_depth is not None:
        millimetres = registered_depth(millimetres, lens.camera, geometry.camera, geometry.target_from_depth)
        if not millimetres.any():
            raise Unusable("no_valid_depth", "the colour camera sees nothing that the depth camera saw")
    return millimetres


def _labels(record: ImageRecord, geometry: CameraGeometry) -> np.ndarray:
    """Labels belong to colour or depth images of their size."""
    labels = label_pixels(record)
    size = (labels.shape[1], labels.shape[0])
    lens = next((lens for lens in (geometry.color, geometry.depth) if lens is not None and lens.size == size), None)
    if lens is None:
        raise Unusable("size_mismatch", f"labels {size[0]}x{size[1]}")
    labels = lens.pixels(labels, "labels")
    if labels.shape != (geometry.camera.height, geometry.camera.width):
        size = (geometry.camera.width, geometry.camera.height)
        labels = cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST)
    return labels
