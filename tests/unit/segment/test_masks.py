"""Masks of a folder: every format gives the artifact that a service gives, and bad ones are refused in one line."""

from __future__ import annotations

import base64
import json
import logging
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.segments import Segments
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.ingest.parameters import STAGE as INGEST
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.masks import encode_panoptic_png
from scenewright.stages.kit.formats.run_lengths import decode_rle, encode_rle
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.services.segmentation_protocol import PROTOCOL
from scenewright.stages.kit.stage import Context
from scenewright.stages.segment.backends.masks.formats import npz_stacks
from scenewright.stages.segment.backends.masks.given import GivenFrame, GivenMask, Picture, ReadSettings
from scenewright.stages.segment.backends.masks.matching import match_pictures
from scenewright.stages.segment.backends.masks.overlapping import flatten
from scenewright.stages.segment.backends.service import reply_cache
from scenewright.stages.segment.geometric import pixels_at
from scenewright.stages.segment.parameters import SegmentParameters, check
from scenewright.stages.segment.stage import run

from tests.unit.segment.test_service import FAST, FakeServer, serving
from tests.unit.segment.test_stage import NAMES, Written, payload, write_sequence

REPOSITORY = Path(__file__).resolve().parents[3]
FRAMES = 3
LEAST_PIXELS = SegmentParameters().small_object_pixels
KINDS = {entry.name: entry.kind for entry in load_vocabulary().classes}
CATEGORIES = [{"id": 10 * k, "name": name, "isthing": int(KINDS[name] == "thing")} for k, name in NAMES.items()]
SCORES = {10 * k: round(1 - 0.0625 * k, 4) for k in NAMES}


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_sequence(tmp_path_factory.mktemp("room") / "sequence", frames=FRAMES)


@pytest.fixture(autouse=True)
def replies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(reply_cache.ENVIRONMENT, str(tmp_path / "replies"))


def segment(room: Written, out: Path, masks: Path | None, backend: str = "masks", **more: Any) -> Segments:
    out.mkdir(parents=True)
    labels = more.pop("labels", None)
    context = Context(output=out, seed=0, device="cpu", progress=SilentProgress())
    fast = FAST if backend.startswith("http") else {}
    parameters = SegmentParameters(backend=backend, **{**fast, **more})
    return run(room.sequence, masks=masks, labels=labels, parameters=parameters, context=context)


def truth(room: Written) -> list[np.ndarray]:
    """Id images (H, W): ten times the number of the surface."""
    with FrameReader(room.sequence.path("frames.mcap")) as reader:
        found = [frame.labels for frame in reader.frames(streams=("labels",))]
    return [image.astype(np.int32) for image in found if image is not None]


def ids_of(image: np.ndarray) -> list[int]:
    return [value for value in np.unique(image).tolist() if value]


def compressed(mask: np.ndarray) -> dict[str, Any]:
    """pycocotools' text, written here a second time, run by run, as its C code does."""
    runs = encode_rle(mask)["counts"]
    text = ""
    for k, run_length in enumerate(runs):
        value = run_length - runs[k - 2] if k > 2 else run_length
        while True:
            piece, value = value & 31, value >> 5
            more = value != -1 if piece & 16 else value != 0
            text += chr((piece | 32 if more else piece) + 48)
            if not more:
                break
    return {"size": list(mask.shape), "counts": text}


# ---- writers, one a format -----------------------------------------------------------------------------------------


def coco_panoptic(root: Path, images: list[np.ndarray], scores: bool = True) -> None:
    rows = []
    for k, image in enumerate(images):
        (root / f"{k:06d}.png").write_bytes(encode_panoptic_png(image))
        segments = [{"id": v, "category_id": v, **({"score": SCORES[v]} if scores else {})} for v in ids_of(image)]
        rows.append({"image_id": k, "file_name": f"{k:06d}.png", "segments_info": segments})
    (root / "panoptic.json").write_text(json.dumps({"annotations": rows, "categories": CATEGORIES}))


def coco_instances(root: Path, images: list[np.ndarray], encode: Callable[..., Any] = compressed) -> None:
    rows = [
        {"image_id": k + 100, "category_id": v, "score": SCORES[v], "segmentation": encode(image == v)}
        for k, image in enumerate(images)
        for v in ids_of(image)
    ]
    pictures = [{"id": k + 100, "file_name": f"rgb/frame-{k}.color.png"} for k in range(len(images))]
    data = {"images": pictures, "annotations": rows, "categories": CATEGORIES}
    (root / "instances.json").write_text(json.dumps(data))


def coco_results(root: Path, images: list[np.ndarray]) -> None:
    coco_instances(root, images, encode_rle)
    rows = json.loads((root / "instances.json").read_text())["annotations"]
    (root / "instances.json").write_text(json.dumps([{**row, "image_id": row["image_id"] - 100} for row in rows]))
    (root / "classes.json").write_text(json.dumps(CATEGORIES))


def npz_stack(root: Path, images: list[np.ndarray]) -> None:
    for k, image in enumerate(images):
        values = ids_of(image)
        np.savez_compressed(
            root / f"{k / 10:.6f}.npz",
            masks=np.array([image == v for v in values]).reshape(-1, *image.shape),
            classes=np.array([NAMES[v // 10] for v in values], dtype=str),
            scores=np.array([SCORES[v] for v in values], dtype=np.float32),
        )


def npz_ids(root: Path, images: list[np.ndarray]) -> None:
    (root / "classes.txt").write_text("".join(f"{10 * k} {name}  # a comment\n" for k, name in NAMES.items()))
    for k, image in enumerate(images):
        values = np.array(ids_of(image))
        scores = np.array([SCORES[v] for v in values.tolist()])
        np.savez(root / f"{k:06d}.npz", ids=image.astype(np.uint16), id=values, classes=values, scores=scores)


def instance_png(root: Path, images: list[np.ndarray], kind: type = np.uint8, scores: bool = True) -> None:
    for k, image in enumerate(images):
        cv2.imwrite(str(root / f"{k:06d}.png"), image.astype(kind))
        if scores:
            said = {str(v): {"class": NAMES[v // 10], "score": SCORES[v]} for v in ids_of(image)}
            (root / f"{k:06d}.json").write_text(json.dumps(said))
    if not scores:
        (root / "classes.json").write_text(json.dumps({str(10 * k): name for k, name in NAMES.items()}))


def sixteen_bits(root: Path, images: list[np.ndarray]) -> None:
    instance_png(root, images, np.uint16)


FORMATS = {
    "COCO panoptic": coco_panoptic,
    "COCO instances, compressed": coco_instances,
    "COCO results, uncompressed": coco_results,
    "NPZ masks": npz_stack,
    "NPZ ids": npz_ids,
    "instance PNG, 8 bits": instance_png,
    "instance PNG, 16 bits": sixteen_bits,
}


def reply(image: np.ndarray, scores: bool) -> bytes:
    segments = [{"id": v, "category_id": v, **({"score": SCORES[v]} if scores else {})} for v in ids_of(image)]
    png = base64.b64encode(encode_panoptic_png(image)).decode()
    return json.dumps({"protocol": PROTOCOL, "segments_info": segments, "panoptic_png": png}).encode()


def through_service(room: Written, out: Path, scores: bool = True) -> Segments:
    images = truth(room)
    info = {
        "protocol": PROTOCOL,
        "name": "mine",
        "revision": "1",
        "streams": ["color"],
        "required": ["color"],
        "categories": CATEGORIES,
    }
    with serving(FakeServer(lambda k: (200, {}, reply(images[k], scores)), json.dumps(info).encode())) as address:
        return segment(room, out, None, address)


# ---- the same masks are the same artifact --------------------------------------------------------------------------


@pytest.mark.parametrize("name", FORMATS)
def test_a_folder_gives_what_the_service_gives(room: Written, tmp_path: Path, name: str) -> None:
    service = through_service(room, tmp_path / "service")
    assert {s.score for frame in service.info.frames for s in frame.segments if s.class_id} - {1.0}
    folder = tmp_path / "masks"
    folder.mkdir()
    FORMATS[name](folder, truth(room))
    model = service.info.label.removeprefix("masks of ")
    made = segment(room, tmp_path / "out", folder, masks_model=model)
    assert payload(made) == payload(service)  # segments.json and panoptic.zip, byte by byte


def test_scores_that_a_format_cannot_hold_are_said_to_be_lost(
    room: Written, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    service = through_service(room, tmp_path / "service", scores=False)
    model = service.info.label.removeprefix("masks of ")
    for name, write in {"png": instance_png, "panoptic": coco_panoptic}.items():
        folder = tmp_path / name
        folder.mkdir()
        write(folder, truth(room), scores=False)
        caplog.clear()
        with caplog.at_level(logging.INFO, "scenewright"):
            made = segment(room, tmp_path / f"out {name}", folder, masks_model=model)
        assert payload(made) == payload(service)
        assert "holds no scores and overlaps" in caplog.text and "3 of 3 frames: 3 by name" in caplog.text


def test_class_agnostic_masks_are_objects(room: Written, tmp_path: Path) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    for k, image in enumerate(truth(room)):
        rows = [
            {"segmentation": encode(image == v), "predicted_iou": 1.01, "stability_score": 0.97, "area": 1}
            for v, encode in zip(ids_of(image), [compressed, encode_rle] * 9, strict=False)
        ]
        rows.append({"segmentation": encode_rle(image >= 0), "predicted_iou": 0.1, "stability_score": 1.0})
        (folder / f"frame_{k}.json").write_text(json.dumps(rows))
    made = segment(room, tmp_path / "out", folder)
    classes = {s.class_id for frame in made.info.frames for s in frame.segments if s.class_id}
    assert classes == {load_vocabulary().by_name("object").id}
    assert made.info.label == "masks of masks"
    assert {s.score for frame in made.info.frames for s in frame.segments if s.class_id} == {0.97}


def test_labels_of_ones_own_and_numbers_without_names(room: Written, tmp_path: Path) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    coco_results(folder, truth(room))
    (folder / "classes.json").unlink()
    with pytest.raises(BadInput, match="nothing says what category"):
        segment(room, tmp_path / "nameless", folder)
    table = tmp_path / "mine.toml"
    rows = [f'{{ name = "n{k}", id = {10 * k}, class = "{name}" }}' for k, name in NAMES.items()]
    table.write_text(f"labels = [{', '.join(rows)}]")
    made = segment(room, tmp_path / "named", folder, labels=table)
    known = {load_vocabulary().by_name(name).id for name in NAMES.values()}
    assert {s.class_id for frame in made.info.frames for s in frame.segments if s.class_id} <= known


def test_a_divisor_makes_classes_of_numbers(room: Written, tmp_path: Path) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    for k, image in enumerate(truth(room)):
        cv2.imwrite(str(folder / f"{k:06d}.png"), np.where(image > 0, image * 100 + 3, 0).astype(np.uint16))
    classes = {"divisor": 1000, "classes": {str(k): name for k, name in NAMES.items()}}
    (folder / "classes.json").write_text(json.dumps(classes))
    made = segment(room, tmp_path / "out", folder)
    other = tmp_path / "other"
    other.mkdir()
    instance_png(other, truth(room), scores=False)
    assert made.info.frames == segment(room, tmp_path / "plain", other).info.frames


# ---- matching ------------------------------------------------------------------------------------------------------


TIMES = np.array([10.0, 10.1, 10.2])


@pytest.mark.parametrize(
    ("names", "way"),
    [
        (("000000", "000001", "000002"), "name"),
        (("frame-0.color2", "frame-1.color2", "frame-2.color2"), "number"),
        (("10.000001", "10.099", "10.21"), "time stamp"),
        (("0010000000000", "0010100000000", "0010200000000"), None),
    ],
)
def test_frames_are_found_by_name_number_or_stamp(names: tuple[str, ...], way: str | None) -> None:
    pictures = [Picture(name) for name in names]
    if way is None:  # thirteen digits are milliseconds
        with pytest.raises(BadInput, match="3 of 3 masks are of frames outside the sequence"):
            match_pictures(pictures, TIMES, 0.02, Path("m"))
        return
    matching = match_pictures(pictures, TIMES, 0.02, Path("m"))
    assert matching.places == {0: 0, 1: 1, 2: 2} and matching.ways == {way: 3} and not matching.warnings


def test_nanoseconds_and_numbers_of_images() -> None:
    now = 1700000000.5
    for picture in (Picture("1700000000500000000"), Picture("x_9", None, 1700000000500)):
        assert match_pictures([picture], np.array([now - 1, now]), 0.02, Path("m")).places == {1: 0}
    assert match_pictures([Picture("", 2)], TIMES, 0.02, Path("m")).places == {2: 0}
    with pytest.raises(BadInput, match="both of frame 1"):
        match_pictures([Picture("000001"), Picture("", 1)], TIMES, 0.02, Path("m"))


def test_frames_without_masks_are_said(room: Written, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    coco_panoptic(folder, truth(room)[:1])
    made = segment(room, tmp_path / "out", folder)
    assert "2 of 3 frames have no masks, the first is 1" in caplog.text
    assert [any(s.class_id for s in frame.segments) for frame in made.info.frames] == [True, False, False]


# ---- overlaps ------------------------------------------------------------------------------------------------------


def test_overlaps_are_resolved_the_same_way_whatever_the_order() -> None:
    shape = (40, 60)
    large, small, twin = (np.zeros(shape, dtype=bool) for _ in range(3))
    large[5:35, 5:55], small[10:20, 10:20], twin[10:20, 10:21] = True, True, True
    masks, told = [small, large, twin], [GivenMask(1, 0.9), GivenMask(2, 0.5), GivenMask(3, 0.95)]
    chosen = ReadSettings(0.3, 20)
    frame = flatten(masks, told, chosen, shape)
    assert set(frame.masks) == {2, 3} and frame.overlapping == 2  # the better twin stays, and lies over the large one
    assert np.array_equal(frame.ids == 3, twin) and np.array_equal(frame.ids == 2, large & ~twin)
    backwards = flatten(masks[::-1], told[::-1], chosen, shape)
    assert np.array_equal(np.array([0, 3, 2, 1])[backwards.ids], frame.ids)
    assert flatten(masks, [GivenMask(1, 0.1)] * 3, chosen, shape).faint == 3


def test_overlaps_are_reported(room: Written, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "masks"
    folder.mkdir()
    for k, image in enumerate(truth(room)):
        masks = np.array([image == v for v in ids_of(image)] + [image >= 0])
        np.savez(folder / f"{k}.npz", masks=masks)
    segment(room, tmp_path / "out", folder)
    assert "masks overlap in 3 frames" in caplog.text and "smaller ones lie over larger" in caplog.text


# ---- masks without classes, and masks that overlap, are treated alike whatever holds them ---------------------------


def stacks(room: Written) -> list[np.ndarray]:
    """(N, H, W) bool a frame: the true masks, and three that lie over others: a patch, a twin of the first that is half
    a pixel off, and one of which little is left."""
    found = []
    for image in truth(room):
        masks = [image == v for v in ids_of(image)]
        patch, hidden = np.zeros(image.shape, bool), np.zeros(image.shape, bool)
        patch[10:30, 10:40], hidden[11:29, 11:43] = True, True
        found.append(np.array([*masks, patch, np.roll(masks[0], 1, axis=1), hidden]))
    return found


def score_of_mask(k: int) -> float:
    return round(0.95 - 0.04 * k, 4)


def write_overlapping(root: Path, kind: str, given: list[np.ndarray], classes: bool) -> None:
    """One folder of masks that may overlap, of a category each or of none."""
    names = list(NAMES.values())
    rows = []
    for k, masks in enumerate(given):
        encode = compressed if kind == "COCO, compressed" else encode_rle
        told = [{"category_id": 10 + 10 * (n % len(names))} if classes else {} for n in range(len(masks))]
        listed = [
            {"segmentation": encode(mask), "score": score_of_mask(n), **said}
            for n, (mask, said) in enumerate(zip(masks, told, strict=True))
        ]
        rows += [{"image_id": k, **row} for row in listed]
        if kind == "SAM":
            sam = [{"segmentation": row["segmentation"], "predicted_iou": row["score"]} for row in listed]
            (root / f"{k:06d}.json").write_text(json.dumps(sam))
        if kind == "NPZ":
            said = {"classes": np.array([row["category_id"] for row in told])} if classes else {}
            scores = np.array([score_of_mask(n) for n in range(len(masks))])
            np.savez(root / f"{k:06d}.npz", masks=masks, scores=scores, **said)
    if kind == "NPZ" and classes:
        (root / "classes.json").write_text(json.dumps(CATEGORIES))
    if kind.startswith("COCO"):
        pictures = [{"id": k, "file_name": f"{k:06d}.png"} for k in range(len(given))]
        data = {"images": pictures, "annotations": rows, **({"categories": CATEGORIES} if classes else {})}
        (root / "instances.json").write_text(json.dumps(data))


def write_flat(root: Path, kind: str, frames: list[GivenFrame]) -> None:
    """One folder of id images, without classes, as masks that overlapped are when a network has flattened them."""
    rows = []
    for k, frame in enumerate(frames):
        told = [{"id": v, "score": mask.score} for v, mask in frame.masks.items()]
        rows.append({"image_id": k, "file_name": f"{k:06d}.png", "segments_info": told})
        if kind == "COCO panoptic":
            (root / f"{k:06d}.png").write_bytes(encode_panoptic_png(frame.ids))
        else:
            values = np.array(sorted(frame.masks))
            scores = np.array([frame.masks[v].score for v in values.tolist()])
            np.savez(root / f"{k:06d}.npz", ids=frame.ids, id=values, scores=scores)
    if kind == "COCO panoptic":
        (root / "panoptic.json").write_text(json.dumps({"annotations": rows}))


def flattened(room: Written) -> list[GivenFrame]:
    frames = []
    for masks in stacks(room):
        told = [GivenMask(None, score_of_mask(k)) for k in range(len(masks))]
        shape = (masks.shape[1], masks.shape[2])
        frames.append(flatten(list(masks), told, ReadSettings(0.3, pixels_at(LEAST_PIXELS, shape)), shape))
    return frames


def test_overlapping_masks_with_classes_are_the_same_artifact(room: Written, tmp_path: Path) -> None:
    made = {}
    for kind in ("NPZ", "COCO, compressed", "COCO, uncompressed"):
        folder = tmp_path / kind
        folder.mkdir()
        write_overlapping(folder, kind, stacks(room), classes=True)
        made[kind] = payload(segment(room, tmp_path / f"out {kind}", folder, masks_model="mine"))
    assert made["NPZ"] == made["COCO, compressed"] == made["COCO, uncompressed"]


def test_masks_without_classes_are_the_same_artifact_in_every_format_and_through_a_service(
    room: Written, tmp_path: Path
) -> None:
    frames = flattened(room)
    assert any(frame.overlapping for frame in frames)  # the patch lies over others, the twin and the hidden are dropped
    category = [{"id": 1, "name": "object", "isthing": 1}]
    info = {"protocol": PROTOCOL, "name": "mine", "revision": "1", "streams": ["color"], "required": ["color"]}

    def answer(k: int) -> tuple[int, dict[str, str], bytes]:
        told = [{"id": v, "category_id": 1, "score": mask.score} for v, mask in frames[k].masks.items()]
        png = base64.b64encode(encode_panoptic_png(frames[k].ids)).decode()
        body = {"protocol": PROTOCOL, "segments_info": told, "panoptic_png": png}
        return 200, {}, json.dumps(body).encode()

    with serving(FakeServer(answer, json.dumps({**info, "categories": category}).encode())) as address:
        service = segment(room, tmp_path / "service", None, address)
    model = service.info.label.removeprefix("masks of ")
    assert {s.score for frame in service.info.frames for s in frame.segments if s.class_id} - {1.0}
    for kind in ("NPZ", "COCO, compressed", "COCO, uncompressed", "SAM", "COCO panoptic", "NPZ ids"):
        folder = tmp_path / kind
        folder.mkdir()
        if kind in ("COCO panoptic", "NPZ ids"):
            write_flat(folder, kind, frames)
        else:
            write_overlapping(folder, kind, stacks(room), classes=False)
        made = segment(room, tmp_path / f"out {kind}", folder, masks_model=model)
        assert payload(made) == payload(service), kind


def test_instance_images_without_a_class_file_differ_by_their_scores_alone(room: Written, tmp_path: Path) -> None:
    frames = [GivenFrame(frame.ids, dict.fromkeys(frame.masks, GivenMask(None))) for frame in flattened(room)]
    (tmp_path / "panoptic").mkdir()
    write_flat(tmp_path / "panoptic", "COCO panoptic", frames)
    (tmp_path / "png").mkdir()
    for k, frame in enumerate(frames):
        cv2.imwrite(str(tmp_path / "png" / f"{k:06d}.png"), frame.ids.astype(np.uint16))
    first, second = (
        payload(segment(room, tmp_path / f"out {name}", tmp_path / name, masks_model="mine"))
        for name in ("panoptic", "png")
    )
    assert first == second


# ---- run lengths ---------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 30), st.integers(1, 40), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.03, 0.5, 1.0]))
def test_run_lengths_come_back(height: int, width: int, seed: int, share: float) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < share
    assert np.array_equal(decode_rle(encode_rle(mask), mask.shape), mask)
    assert np.array_equal(decode_rle(compressed(mask), mask.shape), mask)


def test_the_text_is_that_of_pycocotools() -> None:
    """What pycocotools.mask.encode gives for this mask."""
    mask = np.zeros((4, 5), dtype=bool)
    mask[1:3, 1:4] = True
    assert compressed(mask)["counts"] == "5220003"
    assert encode_rle(mask)["counts"] == [5, 2, 2, 2, 2, 2, 5]


@pytest.mark.parametrize(
    ("encoding", "message"),
    [
        ({"size": [4, 5], "counts": [5, 20]}, "adds up to 25 pixels"),
        ({"size": [4, 5], "counts": [5, 10**9]}, "adds up to more than the picture"),
        ({"size": [4, 5], "counts": [25, -5]}, "a run of -5"),
        ({"size": [4, 5], "counts": [5, 2]}, "adds up to 7"),
        ({"size": [4, 5], "counts": []}, "adds up to 0"),
        ({"size": [4, 5], "counts": ""}, "adds up to 0"),
        ({"size": [4, 5], "counts": [5.5, 2]}, "no list of integers"),
        ({"size": [4, 5], "counts": "5220200"}, "adds up"),
        ({"size": [4, 5], "counts": "522020e"}, "breaks off"),
        ({"size": [4, 5], "counts": "o" * 40 + "0"}, "more than 2.31"),
        ({"size": [4, 5], "counts": "5\x00"}, "letters that none has"),
        ({"size": [5, 4], "counts": [20]}, "4 x 5 pixels, the frame of 5 x 4"),
        ({"counts": [20]}, "not an RLE"),
        ([[0, 0, 5, 5, 5, 0]], "not an RLE"),
        (None, "not an RLE"),
    ],
)
def test_an_encoding_that_lies_is_refused(encoding: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        decode_rle(encoding, (4, 5))


# ---- bad input -----------------------------------------------------------------------------------------------------


def refusal(room: Written, tmp_path: Path, write: Callable[[Path], object]) -> str:
    folder = tmp_path / "bad"
    folder.mkdir()
    write(folder)
    with pytest.raises(BadInput) as caught:
        segment(room, tmp_path / "out", folder)
    assert "\n" not in caught.value.message
    return caught.value.message


def test_masks_of_another_size(room: Written, tmp_path: Path) -> None:
    small = [image[::2, ::2] for image in truth(room)]
    for k, write in enumerate((coco_panoptic, coco_instances, npz_stack, npz_ids, instance_png)):
        (tmp_path / str(k)).mkdir()
        message = refusal(room, tmp_path / str(k), lambda folder, write=write: write(folder, small))
        assert message.startswith("frame 0: ") and "the frame" in message


def test_ids_beyond_the_class_file(room: Written, tmp_path: Path) -> None:
    def write(folder: Path) -> None:
        instance_png(folder, truth(room), scores=False)
        (folder / "classes.json").write_text('{"1": "chair"}')

    assert "is beyond classes.json, which lists 1..1" in refusal(room, tmp_path, write)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("classes.json", '{"1": ""}', "category 1 has no name"),
        ("classes.json", '{"chair": 1}', "a category has no number"),
        ("classes.json", "[1", "no JSON"),
        ("classes.json", "3", "lists no categories"),
        ("classes.txt", "chair\n", "a category has no number"),
        ("000000.json", "[]", "no object of values"),
        ("000000.json", '{"1": 7}', "says no class"),
        ("000000.json", '{"1": {"class": "chair", "score": 7}}', "not in 0..1"),
        ("classes.json", '{"1": "qwertz"}', "are in no table"),
    ],
)
def test_labels_without_names(room: Written, tmp_path: Path, name: str, text: str, message: str) -> None:
    def write(folder: Path) -> None:
        cv2.imwrite(str(folder / "000000.png"), truth(room)[0].astype(np.uint8))
        (folder / name).write_text(text)

    assert message in refusal(room, tmp_path, write)


def test_broken_folders(room: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(npz_stacks, "LARGEST_FILE", 2**21)
    images = truth(room)

    def unlisted(folder: Path) -> None:
        coco_panoptic(folder, images)
        data = json.loads((folder / "panoptic.json").read_text())
        data["annotations"][0]["segments_info"].pop()
        (folder / "panoptic.json").write_text(json.dumps(data))

    def lost(folder: Path) -> None:
        coco_panoptic(folder, images)
        (folder / "000001.png").unlink()

    def beyond(folder: Path) -> None:
        instance_png(folder, images, scores=False)
        (folder / "000000.png").rename(folder / "000009.png")

    def torn(folder: Path) -> None:
        instance_png(folder, images, scores=False)
        data = (folder / "000000.png").read_bytes()
        (folder / "000000.png").write_bytes(data[: len(data) // 2])

    def bomb(folder: Path) -> None:
        with (
            zipfile.ZipFile(folder / "000000.npz", "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open("masks.npy", "w", force_zip64=True) as file,
        ):
            for _ in range(3):
                file.write(bytes(2**20))

    def pickled(folder: Path) -> None:
        np.savez(folder / "000000.npz", masks=np.array([{}], dtype=object))

    def colours(folder: Path) -> None:
        cv2.imwrite(str(folder / "000000.png"), np.full((*images[0].shape, 3), (1, 2, 3), np.uint8))

    def text(folder: Path) -> None:
        (folder / "readme.md").write_text("masks")

    cases = {
        unlisted: "is not in segments_info",
        lost: "its image '000001.png' is not in",
        torn: "cannot hold",
        beyond: "1 of 3 masks are of frames outside the sequence: 000009 (name 9)",
        bomb: "unpacks to more than",
        pickled: "holds object",
        colours: "a colour image without a table of its classes",
        text: "holds no masks that are read here",
    }
    for write, message in cases.items():
        (tmp_path / write.__name__).mkdir()
        assert message in refusal(room, tmp_path / write.__name__, write), write.__name__


def test_masks_and_their_backend_belong_together() -> None:
    with pytest.raises(UsageError, match="needs a folder"):
        check(SegmentParameters(backend="masks"), {})
    with pytest.raises(UsageError, match="is for --backend masks alone"):
        check(SegmentParameters(backend="geometric"), {"masks": Path("m")})


def test_the_script_of_the_page_writes_such_a_folder(room: Written, tmp_path: Path) -> None:
    """The python block of docs/MASKS.md, on a sequence, with a network that knows nothing but brightness."""
    text = (REPOSITORY / "docs" / "MASKS.md").read_text()
    (block,) = [part.split("```")[0] for part in text.split("```python\n")[1:]]
    assert len(block.strip().splitlines()) <= 12
    sequence = tmp_path / "outputs" / "room" / "sequence"
    sequence.parent.mkdir(parents=True)
    log = room.sequence.path("frames.mcap")
    run_stage(INGEST, {"log": log}, sequence, INGEST.parameters())
    network = (
        "import numpy as np\n"
        "def my_network(color):\n"
        "    masks = np.stack([color[..., 0] < 60, color[..., 0] >= 60])\n"
        "    return masks, ['wall', 'table'], [0.9, 0.8]\n"
    )
    (tmp_path / "my_model.py").write_text(network)
    script = tmp_path / "write_masks.py"
    script.write_text(block)
    done = subprocess.run(
        [sys.executable, script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": f"{REPOSITORY}:{tmp_path}", "PATH": "/usr/bin:/bin"},
    )
    assert done.returncode == 0, done.stderr
    made = segment(Written(Sequence(sequence), []), tmp_path / "segments", tmp_path / "outputs" / "room" / "masks")
    assert len(list((tmp_path / "outputs" / "room" / "masks").iterdir())) == FRAMES
    names = {load_vocabulary().by_id(s.class_id).name for f in made.info.frames for s in f.segments if s.class_id}
    assert names <= {"wall", "table"} and names
