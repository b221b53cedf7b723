"""Several networks judge a frame: which masks are one thing, who said what, and what one that cannot be used costs."""

from __future__ import annotations

import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency, UsageError
from scenewright.schemas.segments import FrameSegment, SegmentsFile, Witness
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.fusion import FusionSettings
from scenewright.stages.segment.fusion_ours import fuse
from scenewright.stages.segment.one_frame import describe
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
from scenewright.stages.segment.parameters import SegmentParameters, check
from scenewright.stages.segment.registry import backends_for, check_backend
from scenewright.stages.segment.several import SeveralBackends, agreed, numbered

from tests.unit.segment.tiny_tflite import Interpreter, run_by, written, yolo

VOCABULARY = load_vocabulary()
OBJECT = VOCABULARY.by_name(UNNAMED).id
SHAPE = (20, 30)
Told = tuple[str, float, slice, slice]
EVERYWHERE = (slice(None), slice(None))


def frame_of(*told: Told) -> PanopticFrame:
    ids = np.zeros(SHAPE, np.int32)
    masks = {}
    for number, (name, score, rows, columns) in enumerate(told, start=1):
        ids[rows, columns] = number
        semantic = VOCABULARY.by_name(name)
        masks[number] = PanopticMask(semantic.id, semantic.kind == "thing", score)
    return PanopticFrame(ids, masks)


def together(*frames: PanopticFrame) -> list[tuple[str, float, int, list[int]]]:
    """Name, score, pixels and networks of what several frames come to."""
    one = agreed([numbered(frame, k) for k, frame in enumerate(frames)], unnamed=OBJECT)
    return [
        (VOCABULARY.by_id(mask.class_id).name, round(mask.score, 3), int((one.ids == k).sum()), networks(mask))
        for k, mask in one.masks.items()
    ]


def networks(mask: PanopticMask) -> list[int]:
    return [witness.network for witness in mask.witnesses]


def test_masks_of_one_thing_are_one_with_several_witnesses() -> None:
    here, there, apart = (slice(0, 10), slice(0, 10)), (slice(0, 10), slice(1, 11)), (slice(12, 20), slice(20, 30))
    first, second = frame_of(("chair", 0.4, *here)), frame_of(("chair", 0.3, *there), ("cup", 0.5, *apart))
    assert together(first, second) == [("chair", 0.7, 100, [0, 1]), ("cup", 0.5, 80, [1])]
    sofa = frame_of(("sofa", 0.6, *here))
    assert together(first, second, sofa)[0] == ("chair", 0.7, 100, [0, 1, 2])
    assert together(frame_of(("chair", 0.8, *here)), frame_of(("chair", 0.9, *here)))[0][1] == 1.0, "at most 1"


def test_equal_sums_go_to_the_first_network_and_a_name_goes_before_object() -> None:
    chair, sofa, nameless = (frame_of((name, 0.5, *EVERYWHERE)) for name in ("chair", "sofa", UNNAMED))
    assert together(chair, sofa)[0][0] == "chair" and together(sofa, chair)[0][0] == "sofa"
    assert together(frame_of((UNNAMED, 0.9, *EVERYWHERE)), chair) == [("chair", 0.5, 600, [0, 1])]
    assert together(nameless, nameless) == [(UNNAMED, 1.0, 600, [0, 1])]


def test_stuff_of_a_class_is_one_and_lies_below_and_the_weaker_of_nested_things_goes() -> None:
    left, right, middle = (slice(None), slice(0, 12)), (slice(None), slice(10, 30)), (slice(5, 15), slice(5, 15))
    walls = together(frame_of(("wall", 0.5, *left)), frame_of(("wall", 0.4, *right)), frame_of(("cup", 0.3, *middle)))
    assert walls == [("wall", 0.9, 500, [0, 1]), ("cup", 0.3, 100, [2])]
    assert together(frame_of(("chair", 0.5, *left)), frame_of(("chair", 0.4, slice(5, 15), slice(2, 9)))) == [
        ("chair", 0.5, 240, [0])
    ]


def test_a_wall_everywhere_takes_no_thing_away() -> None:
    wall, table = frame_of(("wall", 0.9, *EVERYWHERE)), frame_of(("table", 0.4, slice(2, 20), slice(None)))
    assert together(wall, table) == [("wall", 0.9, 60, [0]), ("table", 0.4, 540, [1])]
    floor = frame_of(("floor", 0.5, *EVERYWHERE))
    assert together(wall, floor, floor) == [("floor", 1.0, 600, [0, 1, 2])], "which stuff it is they say together"


def test_what_keeps_less_than_half_hides_nothing() -> None:
    cups = (("cup", 0.4, slice(4, 16), slice(0, 13)), ("cup", 0.4, slice(4, 16), slice(16, 29)))
    table = ("table", 0.5, slice(3, 17), slice(None))
    told = together(frame_of(("wall", 0.5, *EVERYWHERE)), frame_of(table), frame_of(*cups))
    assert told == [("wall", 0.5, 600 - 312, [0]), ("cup", 0.4, 156, [2]), ("cup", 0.4, 156, [2])]


def test_witnesses_come_through_the_fusion_into_the_record_and_stay_out_where_there_is_one() -> None:
    one = agreed([numbered(frame_of(("chair", 0.33333, *EVERYWHERE)), k) for k in range(2)], unnamed=OBJECT)
    points = np.dstack([*np.mgrid[0:20, 0:30] * 0.001, np.ones(SHAPE)]).astype(np.float32)
    segment = describe(0, fuse(np.ones(SHAPE, np.int32), one, points, FusionSettings())).segments[0]
    chair = VOCABULARY.by_name("chair").id
    assert segment.witnesses == tuple(Witness(network=k, class_id=chair, score=0.3333) for k in range(2))
    assert FrameSegment.model_validate_json(segment.model_dump_json()) == segment
    alone = segment.model_copy(update={"witnesses": ()})
    record: Any = SegmentsFile(backend="a", label="a", width=1, height=1, frames=())
    assert "witnesses" not in alone.model_dump_json() and "networks" not in record.model_dump_json()


def judged(weights: Path | None, backend: str = "tflite", **options: Any) -> tuple[Any, PanopticFrame]:
    request = BackendRequest(SegmentParameters(backend=backend, **options.pop("options", {})), weights, **options)
    made: Any = choose_backend(request)
    geometric: Any = SimpleNamespace(labels=np.zeros((64, 64), dtype=np.int32))
    frame = Frame(0, 0.0, np.zeros((64, 64, 3), np.uint8), None, None, None)
    return made, made(frame, geometric, np.random.default_rng(0))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Ten networks: eight of instances, of two sizes of picture, one of rooms, and one that is none."""
    names = [f"net{k}" for k in range(8)]
    rooms = Interpreter({"a": np.ones((1, 64, 64), np.int64)}, shape=(1, 64, 64, 3), classes=32)
    nets = {
        name: Interpreter(yolo(side=32 if k == 3 else 64), shape=(1, *([32 if k == 3 else 64] * 2), 3))
        for k, name in enumerate(names)
    }
    run_by(monkeypatch, {**nets, "rooms": rooms})
    (tmp_path / "weights").mkdir()
    for name in (*names, "rooms", "torn"):
        written(tmp_path / "weights" / f"{name}.tflite")
    return tmp_path / "weights"


def test_ten_networks_of_two_sizes_and_one_that_fails(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    written(folder / "other.onnx")
    with caplog.at_level(logging.WARNING):
        made, frame = judged(folder)
    said = [record.message for record in caplog.records if record.levelno == logging.WARNING]
    assert said[0] == "other.onnx: no backend that was asked for runs it"
    assert len(said) == 2 and "torn.tflite" in said[1] and "\n" not in said[1]
    assert len(made.networks) == 9 and made.name == "tflite"
    by_name = {VOCABULARY.by_id(mask.class_id).name: mask for mask in frame.masks.values()}
    assert sorted(by_name) == ["chair", "cup", "wall"] and networks(by_name["wall"]) == [8]
    assert sorted(networks(by_name["cup"])) == list(range(8)) and by_name["cup"].score == 1.0
    again = judged(folder)[1]
    assert np.array_equal(again.ids, frame.ids) and again.masks == frame.masks


def test_only_networks_that_cannot_be_used_are_an_error(folder: Path) -> None:
    for file in folder.glob("*.tflite"):
        if file.stem != "torn":
            file.unlink()
    with pytest.raises(BadInput, match=r"torn\.tflite"):
        judged(folder)
    (folder / "torn.tflite").unlink()
    with pytest.raises(BadInput, match=r"holds no network .*\.tflite"):
        judged(folder)


def test_a_sidecar_lies_beside_its_network(folder: Path) -> None:
    sidecar = 'layout = "semantic"\nlabels = ["wall", "floor"]\n[outputs]\nclasses = "a"\n'
    (folder / "rooms.toml").write_text(sidecar)
    assert "floor" in [VOCABULARY.by_id(mask.class_id).name for mask in judged(folder)[1].masks.values()]
    with pytest.raises(UsageError, match="for one network .*beside"):
        judged(folder, sidecar=folder / "rooms.toml")


def test_weights_go_to_the_backend_that_can_run_them(folder: Path) -> None:
    with pytest.raises(MissingDependency, match="--backend onnx needs a network"):
        judged(folder / "net0.tflite", "tflite+onnx")
    with pytest.raises(BadInput, match=r"weights\.bin: none of tflite, onnx can run it"):
        judged(folder / "weights.bin", "tflite+onnx")
    with pytest.raises(UsageError, match=r"detector and onnx take files of one ending: \.onnx"):
        judged(folder / "net.onnx", "detector+onnx")
    with pytest.raises(UsageError, match=r"detector and onnx take files of one ending: \.onnx"):
        judged(folder / "net.onnx", "network+detector+onnx")
    with pytest.raises(UsageError, match="--semantic-weights is for --backend detector, tflite, onnx"):
        judged(None, "geometric", semantic_weights=folder / "rooms.tflite")
    with pytest.raises(UsageError, match="--tiles is for --backend detector, tflite, onnx"):
        judged(None, "geometric", options={"tiles": 2})


@pytest.mark.parametrize(
    ("backend", "reason"),
    [
        ("tflite+auto", "one backend"),
        ("tflite+tflite", "twice"),
        ("tflite+tflit", "did you mean"),
        ("tflite+", "no such"),
    ],
)
def test_what_cannot_be_put_together(backend: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        check_backend(backend)


def test_several_are_checked_each() -> None:
    assert check_backend("tflite+http://127.0.0.1:8765/") == "tflite+http://127.0.0.1:8765"
    assert [declared.name for declared in backends_for("detector+masks")] == ["detector", "masks"]
    with pytest.raises(UsageError, match="needs a folder of masks"):
        check(SegmentParameters(backend="tflite+masks"), {})
    check(SegmentParameters(backend="tflite+masks"), {"masks": Path("masks")})


def test_masks_of_another_size_are_refused() -> None:
    class Small:
        name, label, streams = "small", "small network", ()

        def __call__(self, *_: Any) -> PanopticFrame:
            return PanopticFrame(np.zeros((3, 4), np.int32))

    geometric: Any = SimpleNamespace(labels=np.zeros((6, 8), np.int32))
    small: Any = Small()
    with pytest.raises(BadInput, match="small network: its masks are 4x3, the frame is 8x6"):
        SeveralBackends("a+b", [small, small])(
            Frame(0, 0.0, None, None, None, None), geometric, np.random.default_rng(0)
        )
