"""Masks as other tools write them: each layout gives the same table and cup, and what is left out is counted."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.geometry.outlines import fill
from scenewright.stages.segment.backends.masks.backend import open_folder
from scenewright.stages.segment.backends.masks.formats.label_studio import brush_mask
from scenewright.stages.segment.backends.masks.given import GivenFrame, MaskSource, ReadSettings
from scenewright.stages.segment.backends.masks.listing import Listing
from scenewright.stages.segment.backends.masks.matching import match_pictures
from scenewright.stages.segment.backends.masks.names import own_name
from scenewright.stages.segment.backends.masks.polygons import ellipse, polygons_of

from tests.unit.segment.mask_layouts import (
    CUP,
    HEIGHT,
    LAYOUTS,
    SHAPE,
    STACK,
    TABLE,
    TRUE,
    VALUES,
    WIDTH,
    amg,
    brush,
    class_folders,
    coco,
    colors,
    flat,
    palette_png,
    voc,
)

SETTINGS = ReadSettings(0.3, 1)
TIMES = np.arange(4) / 10


def opened(folder: Path) -> tuple[str, MaskSource]:
    form, source = open_folder(Listing(folder))
    return form.name, source


def by_class(frame: GivenFrame, source: MaskSource) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for number, mask in frame.masks.items():
        name = "object" if mask.category is None else source.categories[mask.category].name
        found[name] = found.get(name, np.zeros(SHAPE, bool)) | (frame.ids == number)
    return found


def check_things(folder: Path, form: str, names: dict[str, str] | None = None) -> list[GivenFrame]:
    """Frame 2 has the table and the cup, frame 3 is there and has nothing."""
    name, source = opened(folder)
    assert name == form
    places = match_pictures(source.pictures, TIMES, 0.02, folder).places
    assert sorted(places) == [2, 3]
    frames = [source.read(places[k], SHAPE, SETTINGS) for k in (2, 3)]
    found = by_class(frames[0], source)
    for thing, true in TRUE.items():
        assert np.array_equal(found.pop((names or {}).get(thing, thing)), true), thing
    assert not any(mask.any() for known, mask in found.items() if known != "background")
    assert not any(mask.any() for known, mask in by_class(frames[1], source).items() if known != "background")
    return frames


@pytest.mark.parametrize("layout", LAYOUTS)
def test_table_and_cup_are_the_same_in_every_layout(tmp_path: Path, layout: str) -> None:
    write, form = LAYOUTS[layout]
    write(tmp_path)
    frames = check_things(tmp_path, form)
    left_out = layout.startswith(("YOLO", "parts", "polygons", "names")) or layout in ("LabelMe", "VIA")
    assert frames[0].empty == left_out and frames[1].empty == 0


def test_voc_has_instances_and_names_of_its_own(tmp_path: Path) -> None:
    voc(tmp_path)
    check_things(tmp_path, "coloured PNG", {"table": "diningtable", "cup": "bottle"})
    split = VALUES + (VALUES == 1) * 2 * (np.arange(WIDTH) >= 32)
    palette_png(tmp_path / "SegmentationObject" / "000002.png", split)
    _, source = opened(tmp_path)
    frame = source.read(0, SHAPE, SETTINGS)
    tables = [k for k, mask in frame.masks.items() if source.categories[mask.category or 0].name == "diningtable"]
    assert len(tables) == 2 and sorted(int((frame.ids == k).sum()) for k in tables) == [28 * 24, 28 * 24]


# ---- outlines ------------------------------------------------------------------------------------------------------


def test_outlines_are_filled_as_pycocotools_fills_them() -> None:
    """What frPyObjects, merge and decode give for these (2.0.11)."""
    triangle = fill([np.array([[1.0, 1.0], [6.0, 1.0], [1.0, 6.0]])], (8, 8))
    assert [int(row) for row in triangle.sum(axis=1)] == [0, 4, 3, 2, 1, 0, 0, 0]
    assert np.array_equal(fill([np.array(TABLE, float), np.array(CUP, float)], SHAPE), TRUE["table"] | TRUE["cup"])
    beyond = fill([np.array([[-9.0, -9.0], [100.0, -9.0], [100.0, 3.0], [-9.0, 3.0]])], (5, 7))
    assert beyond[:3].all() and not beyond[3:].any()
    disc = fill([ellipse((32, 24), (10, 10))], SHAPE)
    assert abs(int(disc.sum()) - np.pi * 100) < 4 and disc[24, 32] and not disc[24, 43]


def test_outlines_are_those_of_pycocotools_pixel_by_pixel() -> None:
    tools = pytest.importorskip("pycocotools.mask")
    random = np.random.default_rng(0)
    for k in range(200):
        height, width = (int(n) for n in random.integers(1, 60, 2))
        shape, corners = (height, width), int(random.integers(3, 12))
        polygons = [random.uniform(-20, 80, (corners, 2)), random.integers(0, 60, (4, 2)).astype(float)][: 1 + k % 2]
        code = tools.merge(tools.frPyObjects([polygon.ravel().tolist() for polygon in polygons], *shape))
        assert np.array_equal(fill(polygons, shape), tools.decode(code).astype(bool)), k


@pytest.mark.parametrize(
    ("outline", "count"),
    [([flat(CUP)], 1), (flat(CUP), 1), (CUP, 1), ([], 0), ([[]], 0), ([[1, 2, 3, 4]], 0), ([flat(CUP), [1, 2]], 1)],
)
def test_ways_to_write_polygons(outline: Any, count: int) -> None:
    assert len(polygons_of(outline)) == count


@pytest.mark.parametrize(
    ("segmentation", "size", "message"),
    [
        ([[1, 2, 3, 4, 5]], {}, "mask 1: one of its polygons is not a list of numbers in pairs"),
        ([[1, 2, 3, 4, "5", 6]], {}, "numbers in pairs"),
        ([[0, 0, 200, 0, 200, 90]], {}, r"reaches to \(200, 90\), the frame has 64x48 pixels"),
        ([[0, 0, 60, 0, 60, 40]], {"width": 128, "height": 96}, "of a picture of 128x96, the frame has 64x48"),
        ([[0, 0, 1e8, 0, 1e8, -1e8]], {"width": WIDTH, "height": HEIGHT}, "pixels long"),
    ],
)
def test_outlines_that_cannot_be_filled(tmp_path: Path, segmentation: Any, size: dict[str, int], message: str) -> None:
    coco(tmp_path, lambda thing: segmentation, **size)
    _, source = opened(tmp_path)
    with pytest.raises(BadInput, match=message) as caught:
        source.read(0, SHAPE, SETTINGS)
    assert "image 12" in str(caught.value)


def test_boxes_alone_are_refused(tmp_path: Path) -> None:
    coco(tmp_path, lambda thing: [])
    with pytest.raises(BadInput, match="its annotations are boxes, none has a mask"):
        opened(tmp_path)
    (tmp_path / "instances.json").unlink()
    (tmp_path / "000001.txt").write_text("0 0.5 0.5 0.25 0.25\n")
    with pytest.raises(BadInput, match="none is an outline"):
        opened(tmp_path)


def test_a_brush_that_lies(tmp_path: Path) -> None:
    code = brush(TRUE["cup"])
    assert np.array_equal(brush_mask(code, (WIDTH, HEIGHT), "x"), TRUE["cup"])
    for damaged in (code[:20], code[:2], [300], "x", [255] * 40):
        with pytest.raises(BadInput, match="damaged"):
            brush_mask(damaged, (WIDTH, HEIGHT), "x")


# ---- values --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["PNG", "JSON beside it", "NPZ", "NPZ with id"])
def test_a_class_0_that_a_file_lists_is_a_class(tmp_path: Path, kind: str) -> None:
    values = np.where(TRUE["table"], 0, np.where(TRUE["cup"], 1, 255)).astype(np.uint8)
    if kind == "NPZ with id":
        names = np.array(["table", "cup", "wall"])
        np.savez(tmp_path / "000002.npz", ids=values, id=np.array([0, 1, 255]), classes=names)
    elif kind == "NPZ":
        np.savez(tmp_path / "000002.npz", ids=values)
    else:
        cv2.imwrite(str(tmp_path / "000002.png"), values)
    file = "000002.json" if kind == "JSON beside it" else "classes.json"
    if kind != "NPZ with id":
        (tmp_path / file).write_text(json.dumps({"0": "table", "1": "cup"}))
    _, source = opened(tmp_path)
    frame = source.read(0, SHAPE, SETTINGS)
    found = by_class(frame, source)
    assert np.array_equal(found["table"], TRUE["table"]) and np.array_equal(found["cup"], TRUE["cup"])
    others = int((values == 255).sum())
    assert frame.ignored == (0 if kind == "NPZ with id" else others)  # nothing lists 255: ignore
    assert ("wall" in found) == (kind == "NPZ with id")


def test_0_and_255_without_a_list(tmp_path: Path) -> None:
    """One mask of 255, as networks write it, is a mask; the rim of a palette with objects is none."""
    cv2.imwrite(str(tmp_path / "000001.png"), TRUE["cup"].astype(np.uint8) * 255)
    palette_png(tmp_path / "000002.png", VALUES + 253 * TRUE["cup"])
    _, source = opened(tmp_path)
    grey, rim = (source.read(k, SHAPE, SETTINGS) for k in (0, 1))
    assert np.array_equal(grey.ids > 0, TRUE["cup"]) and grey.ignored == 0
    assert np.array_equal(rim.ids > 0, TRUE["table"]) and rim.ignored == TRUE["cup"].sum()


def test_a_value_beyond_the_list_is_still_refused(tmp_path: Path) -> None:
    (tmp_path / "classes.json").write_text('{"0": "table", "1": "cup"}')
    cv2.imwrite(str(tmp_path / "000001.png"), VALUES.astype(np.uint8))
    _, source = opened(tmp_path)
    with pytest.raises(BadInput, match=r"id 2 is beyond classes.json, which lists 0\.\.1"):
        source.read(0, SHAPE, SETTINGS)


def test_samples_of_few_bits_and_grey_stored_as_colour(tmp_path: Path) -> None:
    (tmp_path / "classes.txt").write_text("1 table\n2 cup\n")
    cv2.imwrite(str(tmp_path / "000001.png"), np.repeat(VALUES[..., None], 3, axis=2).astype(np.uint8))
    image = Image.fromarray(VALUES.astype(np.uint8), mode="P")
    image.putpalette([0, 0, 0, 255, 0, 0, 0, 255, 0, 9, 9, 9])
    image.save(tmp_path / "000002.png", bits=2)
    one_bit = Image.fromarray(TRUE["table"])
    one_bit.save(tmp_path / "000003.png")
    assert one_bit.mode == "1" and (tmp_path / "000003.png").read_bytes()[24] == 1
    _, source = opened(tmp_path)
    for k in range(2):
        found = by_class(source.read(k, SHAPE, SETTINGS), source)
        assert all(np.array_equal(found[name], true) for name, true in TRUE.items()), k
    assert np.array_equal(by_class(source.read(2, SHAPE, SETTINGS), source)["table"], TRUE["table"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("table:250,50,83::\n", "the colour 0,128,0 is not among those of labelmap.txt"),
        ("table:250,50::\n", "says no colour"),
        ("table:1,1,1::\ncup:1,1,1::\n", "have one colour"),
        ("# nothing\n", "lists no labels"),
    ],
)
def test_label_maps_that_do_not_fit(tmp_path: Path, text: str, message: str) -> None:
    colors(tmp_path)
    (tmp_path / "labelmap.txt").write_text(text)
    with pytest.raises(BadInput, match=message):
        opened(tmp_path)[1].read(0, SHAPE, SETTINGS)


# ---- stacks --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("masks", "classes"),
    [
        (STACK[:, None], [0, 1]),
        (STACK.transpose(1, 2, 0), [0, 1]),
        (STACK.astype(np.float32), [0.0, 1.0]),
        (np.where(STACK, 0.9, 0.2)[:, None], [0, 1]),
        (STACK.astype(np.uint8) * 255, np.array([b"table", b"cup"])),
        (STACK, [[0], [1]]),
    ],
)
def test_stacks_of_other_shapes_are_read_where_there_is_no_doubt(
    tmp_path: Path, masks: np.ndarray, classes: Any
) -> None:
    np.savez(tmp_path / "000002.npz", masks=masks, classes=np.array(classes), scores=np.array([0.9, 0.8]))
    empty = np.array([])
    np.savez(tmp_path / "000003.npz", masks=empty, classes=empty, scores=empty)
    (tmp_path / "classes.json").write_text('{"0": "table", "1": "cup"}')
    check_things(tmp_path, "NPZ stacks")


@pytest.mark.parametrize(
    ("arrays", "message", "hint"),
    [
        ({"masks": np.where(STACK, 4.0, -3.0)}, "beyond 0..1", "masks=logits > 0"),
        ({"masks": VALUES}, "holds several values", "call an image of values `ids`"),
        ({"masks": STACK[:, ::2, ::2]}, "masks of 32x24", "scale"),
        ({"masks": np.zeros((2, 2, *SHAPE))}, "not \\(N, H, W\\)", r"np.zeros\(\(0, H, W\), bool\)"),
    ],
)
def test_stacks_that_are_not_understood(tmp_path: Path, arrays: Any, message: str, hint: str) -> None:
    np.savez(tmp_path / "000002.npz", **arrays)
    with pytest.raises(BadInput, match=message) as caught:
        opened(tmp_path)[1].read(0, SHAPE, SETTINGS)
    assert caught.value.hint and re.search(hint, caught.value.hint)


def test_logits_are_masks_when_the_advice_is_followed(tmp_path: Path) -> None:
    logits = np.where(STACK, 4.0, -3.0)
    np.savez(tmp_path / "000002.npz", masks=logits > 0, classes=np.array(["table", "cup"]))
    np.savez(tmp_path / "000003.npz", masks=np.zeros((0, HEIGHT, WIDTH), bool))
    check_things(tmp_path, "NPZ stacks")


# ---- a folder a picture --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("names", [("000002", "000003"), ("0.200000", "0.300000"), ("rgb_2", "rgb_3")])
def test_the_folders_of_segment_anything(tmp_path: Path, names: tuple[str, str]) -> None:
    amg(tmp_path, names[0], list(STACK), [1.02, 0.9])
    amg(tmp_path, names[1], [], [])
    form, source = opened(tmp_path)
    places = match_pictures(source.pictures, TIMES, 0.02, tmp_path).places
    assert form == "mask PNGs" and sorted(places) == [2, 3]
    frame = source.read(places[2], SHAPE, SETTINGS)
    assert all(np.array_equal(frame.ids == k, true) for k, true in enumerate(STACK, start=1))
    assert [mask.score for mask in frame.masks.values()] == [0.99, 0.9]
    assert not source.read(places[3], SHAPE, SETTINGS).ids.any()
    _, one = opened(tmp_path / names[0])  # the folder of one picture alone
    assert len(one.pictures) == 1 and one.pictures[0].name == names[0]


@pytest.mark.parametrize("file", ["000002/mask_{}.png", "img_2/mask_{}.png", "obj_{}/img_2.png", "{}/000002.png"])
def test_other_folders_of_single_masks(tmp_path: Path, file: str) -> None:
    for k, mask in enumerate(STACK):
        path = tmp_path / file.format(k)
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), mask.astype(np.uint8))
        other = tmp_path / file.format(k).replace("2", "3")
        other.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(other), mask.astype(np.uint8))
    form, source = opened(tmp_path)
    places = match_pictures(source.pictures, TIMES, 0.02, tmp_path).places
    assert form == "mask PNGs" and sorted(places) == [2, 3]
    frame = source.read(places[2], SHAPE, SETTINGS)
    assert len(frame.masks) == 2 and np.array_equal(frame.ids > 0, STACK.any(axis=0))
    assert {mask.category for mask in frame.masks.values()} == {None}


def test_folders_that_say_nothing(tmp_path: Path) -> None:
    for folder in ("a1", "a2"):
        (tmp_path / folder).mkdir()
        for k in range(2):
            cv2.imwrite(str(tmp_path / folder / f"{k}.png"), TRUE["cup"].astype(np.uint8))
    with pytest.raises(BadInput, match="nothing says whether 'a1' or '0' is a picture"):
        opened(tmp_path)


def test_id_images_in_folders_of_classes_are_more_than_one_mask(tmp_path: Path) -> None:
    class_folders(tmp_path)
    cv2.imwrite(str(tmp_path / "cup" / "000002.png"), VALUES.astype(np.uint8))
    _, source = opened(tmp_path)
    with pytest.raises(BadInput, match="more than one mask"):
        source.read(0, SHAPE, SETTINGS)


# ---- names ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stem", "own"),
    [
        ("000012_png.rf.0a1b2c3d4e5f60718293a4b5c6d7e8f9", "000012"),
        ("frame_0001_jpg.rf.Zx81bYq0Kd", "frame_0001"),
        ("000012_jpeg.rf.0a1b2c3d4e5f60718293a4b5c6d7e8f9_mask", "000012"),
        ("1305031102.175304_png.rf.0a1b2c3d", "1305031102.175304"),
        ("0a1b2c3d-000012", "000012"),
        ("20240131-000012", "20240131-000012"),
        ("frame_0001_jpg", "frame_0001_jpg"),
        ("000012", "000012"),
    ],
)
def test_what_services_put_around_a_name_is_cut_off(stem: str, own: str) -> None:
    assert own_name(stem) == own


def test_two_of_one_frame_say_what_was_seen(tmp_path: Path) -> None:
    hash_of = "0a1b2c3d4e5f60718293a4b5c6d7e8f{}"
    for k in (1, 2):
        cv2.imwrite(str(tmp_path / f"000002_png.rf.{hash_of.format(k)}.png"), VALUES.astype(np.uint8))
    _, source = opened(tmp_path)
    with pytest.raises(BadInput, match=r"000002_png\.rf.*f1\.png.*are both of frame 2") as caught:
        match_pictures(source.pictures, TIMES, 0.02, tmp_path)
    assert "augmented" in (caught.value.hint or "") and "keep one" not in str(caught.value)
    other = tmp_path / "other"
    for folder in ("images", "masks"):
        (other / folder).mkdir(parents=True)
        cv2.imwrite(str(other / folder / "000002.png"), VALUES.astype(np.uint8))
    _, source = opened(other)
    with pytest.raises(BadInput, match=r"'images/000002.png' and 'masks/000002.png'"):
        match_pictures(source.pictures, TIMES, 0.02, other)
    _, source = opened(other / "masks")  # as the message says
    assert match_pictures(source.pictures, TIMES, 0.02, other).places == {2: 0}


def test_several_masks_of_a_picture_lie_in_a_folder_of_its_name(tmp_path: Path) -> None:
    """What the message about two of one frame tells to do."""
    for k, mask in enumerate(STACK):
        cv2.imwrite(str(tmp_path / f"000002_{k}.png"), mask.astype(np.uint8))
        cv2.imwrite(str(tmp_path / f"000003_{k}.png"), mask.astype(np.uint8))
    with pytest.raises(BadInput, match=r"'000002_0.png' and '000003_0.png' are both of frame 0") as caught:
        match_pictures(opened(tmp_path)[1].pictures, TIMES, 0.02, tmp_path)
    assert "000012/0.png" in (caught.value.hint or "")
    for file in tmp_path.glob("*.png"):
        frame, number = file.stem.split("_")
        (tmp_path / frame).mkdir(exist_ok=True)
        file.rename(tmp_path / frame / f"{number}.png")
    _, source = opened(tmp_path)
    places = match_pictures(source.pictures, TIMES, 0.02, tmp_path).places
    assert sorted(places) == [2, 3] and len(source.read(places[2], SHAPE, SETTINGS).masks) == 2


@pytest.mark.parametrize("kind", ["PNG", "NPZ"])
def test_numbers_that_labels_of_ones_own_name(tmp_path: Path, kind: str) -> None:
    """Without a class file the ids of the table given with --labels are meant."""
    if kind == "PNG":
        cv2.imwrite(str(tmp_path / "000002.png"), VALUES.astype(np.uint8))
    else:
        np.savez(tmp_path / "000002.npz", ids=VALUES)
    _, source = open_folder(Listing(tmp_path, {0: "wall", 1: "table", 2: "cup"}))
    found = by_class(source.read(0, SHAPE, SETTINGS), source)
    assert all(np.array_equal(found[name], true) for name, true in TRUE.items())
    assert np.array_equal(found["wall"], VALUES == 0)
    _, source = open_folder(Listing(tmp_path, {1: "table"}))
    with pytest.raises(BadInput, match="id 2 is beyond --labels, which lists 1..1"):
        source.read(0, SHAPE, SETTINGS)


@pytest.mark.parametrize(
    ("name", "message"),
    [("a.xml", "export COCO 1.0"), ("a.npy", "np.savez"), ("a.jpg", "as PNG"), ("a.pkl", "never read")],
)
def test_a_folder_of_another_kind_says_what_to_do(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / name).write_text("x")
    with pytest.raises(BadInput, match=r"holds no masks that are read here \(1 \.") as caught:
        opened(tmp_path)
    assert message in (caught.value.hint or "")
