"""Which backend `segment` takes, and masks of one's own."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.cli.main import run
from scenewright.schemas.segments import Segments
from scenewright.stages.kit.formats.frames import FrameWriter

from tests.advice.rows import NotTried, Tried
from tests.strangers.pictures import COUNT, NAMES, SHOTS, TRUE, overlaps, write_ids
from tests.strangers.rooms import CAMERA
from tests.unit.segment.test_stage import class_image

MASKS = "stages/segment/backends/masks/"
BACKEND, COCO, MATCHING = f"{MASKS}backend.py", f"{MASKS}formats/coco_instances.py", f"{MASKS}matching.py"
CHOICE, OPTIONS = "stages/segment/choice.py", "stages/segment/parameters.py"
NETWORK = "stages/segment/backends/network/backend.py"
SEGMENT = "segment --sequence {pan}/whole --out out"
GIVEN = f"{SEGMENT} --backend masks --masks masks"
GAP = "segment --sequence {pan}/gap --out out --backend masks --masks masks"
BY_LOG, BY_NUMBER = "--masks-named-like log", "--masks-named-like sequence"
ROOM = "segment --sequence {room}/sequence --out out"
UNNAMED = "segment --sequence sequence --out out"
CLASSES = {str(number): name for number, name in NAMES.items()}


def ids(
    numbers: Sequence[int], frames: Sequence[int], name: str = "{:06d}", classes: Any = CLASSES
) -> Callable[[Path], None]:
    """Return what writes the true masks of `frames` as images called by `numbers`, and a class file."""

    def write(folder: Path) -> None:
        for number, frame in zip(numbers, frames, strict=True):
            write_ids(folder / f"masks/{name.format(number)}.png", TRUE[frame].astype(np.uint8))
        (folder / "masks/classes.json").write_text(json.dumps(classes))

    return write


whole = ids(range(COUNT), range(COUNT))


def runs(mask: np.ndarray) -> dict[str, Any]:
    """Return COCO's uncompressed runs of a mask, column by column, the first of what is outside."""
    flat = np.concatenate([[False], mask.T.reshape(-1), [not mask[-1, -1]]])
    return {"size": list(mask.shape), "counts": np.diff(np.flatnonzero(np.diff(flat)), prepend=0).tolist()}


def coco() -> dict[str, Any]:
    """Return the true masks as COCO has them."""
    images = [{"id": k, "file_name": f"{k + 1:06d}.jpg", "height": 120, "width": 160} for k in range(COUNT)]
    rows = [
        {"id": 10 * k + number, "image_id": k, "category_id": number, "segmentation": runs(TRUE[k] == number)}
        for k in range(COUNT)
        for number in np.unique(TRUE[k]).tolist()
    ]
    categories = [{"id": number, "name": name} for number, name in NAMES.items()]
    return {"images": images, "annotations": rows, "categories": categories}


def write_json(path: Path, value: object) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(value))


def without_a_category(folder: Path) -> None:
    """The dataset does not list the cup; beside it are one that does, one with a class file, and a table of labels."""
    dataset = coco()
    write_json(folder / "listed/dataset.json", dataset)
    lacking = dataset | {"categories": [row for row in dataset["categories"] if row["name"] != "cup"]}
    write_json(folder / "masks/dataset.json", lacking)
    write_json(folder / "beside/dataset.json", lacking)
    write_json(folder / "beside/classes.json", CLASSES)
    rows = [f'[[labels]]\nid = {number}\nname = "{name}"\nclass = "{name}"\n' for number, name in NAMES.items()]
    (folder / "labels.toml").write_text('name = "mine"\n' + "".join(rows))


def with_a_faint_cup(folder: Path) -> None:
    dataset = coco()
    for row in dataset["annotations"]:
        row["score"] = 0.2 if NAMES[row["category_id"]] == "cup" else 0.9
    write_json(folder / "masks/dataset.json", dataset)


def dataset_and_results(folder: Path) -> None:
    dataset = coco()
    write_json(folder / "masks/dataset.json", dataset)
    write_json(folder / "masks/results.json", [row | {"score": 0.5} for row in dataset["annotations"]])


def two_tables(folder: Path) -> None:
    dataset = coco()
    write_json(folder / "masks/a.json", dataset)
    dataset["categories"][0]["name"] = "sofa"
    write_json(folder / "masks/b.json", dataset)


def without_a_table(folder: Path) -> None:
    """A log with labels of which nothing says what they mean."""
    with FrameWriter(folder / "frames.mcap", CAMERA, labels=True) as writer:
        for index, ((color, depth, pose), numbers) in enumerate(zip(SHOTS[:2], TRUE, strict=False)):
            writer.write(index / 10, color, depth.astype(np.float32), pose, numbers.astype(np.uint16))
    assert run(["ingest", f"--log={folder}/frames.mcap", f"--out={folder}/sequence", "--gravity=none"]) == 0


def in_place(frames: Sequence[int] = range(COUNT)) -> Callable[[Path], None]:
    """Return a check that every thing lies where it is in `frames` of `out`."""

    def check(folder: Path) -> None:
        found = overlaps(folder / "out", list(frames))
        assert min(found.values()) > 0.8, found

    return check


def any_segments(folder: Path) -> None:
    assert class_image(Segments(folder / "out"), 0).shape


def true_masks(folder: Path) -> None:
    assert Segments(folder / "out").info.label == "ground-truth masks, corruption 0"


def corrupted(folder: Path) -> None:
    assert Segments(folder / "out").info.label == "ground-truth masks, corruption 0.5"


ROWS = [
    Tried(OPTIONS, "needs a folder of masks", f"{SEGMENT} --backend masks", GIVEN, given=whole, right=in_place()),
    Tried(OPTIONS, "leave --masks out", f"{SEGMENT} --masks masks", GIVEN, given=whole, right=in_place()),
    Tried(
        OPTIONS,
        "leave --masks out",
        f"{ROOM} --backend ground-truth --masks masks",
        f"{ROOM} --backend ground-truth",
        given=whole,
        right=true_masks,
    ),
    Tried(
        CHOICE,
        "alone",
        f"{ROOM} --backend geometric --corruption 0.5",
        f"{ROOM} --backend ground-truth --corruption 0.5",
        right=corrupted,
    ),
    Tried(
        CHOICE,
        "use another --backend",
        "segment --sequence {walks}/colourless --out out --backend huggingface",
        "segment --sequence {walks}/colourless --out out --backend geometric",
        code=3,
        then_code=0,
        right=any_segments,
    ),
    Tried(
        "stages/segment/backends/ground_truth/backend.py",
        "no ground-truth labels",
        f"{UNNAMED} --backend ground-truth",
        f"{UNNAMED} --backend geometric",
        code=3,
        given=without_a_table,
        right=any_segments,
    ),
    Tried(
        "stages/segment/stage.py",
        "this sequence has no depth",
        "segment --sequence {pair}/sequence --out out --backend geometric",
        "disparity --sequence {pair}/sequence --out deep && segment --sequence deep --out out --backend geometric",
        code=3,
        right=any_segments,
    ),
    *(
        Tried(
            BACKEND,
            "nothing says what category",
            GIVEN,
            f"{SEGMENT} --backend masks --masks {advised}",
            code=3,
            given=without_a_category,
            right=in_place(),
        )
        for advised in ("listed", "beside", "masks --labels labels.toml")
    ),
    Tried(
        BACKEND,
        "score under --score-threshold",
        GIVEN,
        f"{GIVEN} --score-threshold 0.1",
        code=0,
        given=with_a_faint_cup,
        right=in_place(),
    ),
    Tried(
        COCO, "a list of results", GIVEN, f"{GIVEN}/dataset.json", code=3, given=dataset_and_results, right=in_place()
    ),
    Tried(COCO, "in a file before it", GIVEN, f"{GIVEN}/a.json", code=3, given=two_tables, right=in_place()),
    Tried(
        MATCHING,
        "leave out --masks-named-like",
        f"{GIVEN} {BY_LOG}",
        GIVEN,
        code=3,
        given=ids(range(COUNT), range(COUNT), "mine_{}"),
        right=in_place(),
    ),
    Tried(
        MATCHING,
        "say which: --masks-named-like",
        GAP,
        f"{GAP} {BY_NUMBER}",
        code=3,
        given=ids(range(COUNT), range(COUNT)),
        right=in_place(),
    ),
    Tried(
        MATCHING,
        "say which: --masks-named-like",
        GAP,
        f"{GAP} {BY_LOG}",
        code=3,
        given=ids((0, 1, 2, 3), (5, 0, 1, 2)),
        right=in_place((0, 1, 2)),
    ),
    Tried(
        MATCHING,
        "(--masks-named-like sequence goes by numbers)",
        GIVEN,
        f"{GIVEN} {BY_NUMBER}",
        code=0,
        given=ids(range(1, COUNT), range(1, COUNT)),
        right=in_place(range(1, COUNT)),
    ),
    Tried(
        MATCHING,
        "(--masks-named-like log goes by the log's names)",
        GIVEN,
        f"{GIVEN} {BY_LOG}",
        code=0,
        given=ids((0, 1, 2, 3), (5, 0, 1, 2)),
        right=in_place((0, 1, 2)),
    ),
    NotTried(f"{MASKS}unread.py", "from CVAT export", "CVAT is another program; both its formats are read in tests"),
    NotTried("stages/segment/registry.py", "else what needs nothing", "the help of an option"),
    NotTried(
        "stages/segment/backends/objects/boosting.py",
        "scenewright train tabletop-pairs",
        "training takes a quarter of an hour and recordings that are not in the repository",
    ),
    NotTried(
        "stages/segment/backends/network/weights.py",
        "make train-network",
        "training takes hours; the other half of the advice is the step without --weights, which other tests run",
    ),
]
