"""ONNX networks of the known layouts, each a few nodes that look at the image, run by ONNX Runtime."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.choice import BackendRequest, choose_backend
from scenewright.stages.segment.networks.decoding import _paste_mask
from scenewright.stages.segment.networks.fitting import fit
from scenewright.stages.segment.networks.sidecar import Sidecar, find_layout, read_sidecar
from scenewright.stages.segment.parameters import SegmentParameters

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

VOCABULARY = load_vocabulary()
HEIGHT, WIDTH = 48, 64


def image() -> np.ndarray:
    """Red on the left, blue on the right, black below."""
    pixels = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    pixels[:36, :32, 0], pixels[:36, 32:, 2] = 255, 255
    return pixels


def save(
    path: Path,
    nodes: list[Any],
    outputs: dict[str, list[Any]],
    constants: dict[str, np.ndarray],
    size: Any,
    metadata: dict[str, str] | None = None,
    batch: bool = True,
) -> Path:
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    shape = [1, 3, *size] if batch else [3, *size]
    whole = {"int64": onnx.TensorProto.INT64, "float32": kind}
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("image", kind, shape)],
        [
            helper.make_tensor_value_info(k, whole["int64" if k == "labels" else "float32"], v)
            for k, v in outputs.items()
        ],
        [onnx.numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    for key, value in (metadata or {}).items():
        model.metadata_props.add(key=key, value=value)
    onnx.save(model, str(path))
    return path


def colored(name: str, rows: list[list[float]]) -> tuple[list[Any], dict[str, np.ndarray]]:
    """A 1x1 convolution: one output channel per row of weights (red, green, blue, offset)."""
    weights = np.array(rows, dtype=np.float32)
    node = onnx.helper.make_node("Conv", ["image", f"{name}_w", f"{name}_b"], [name])
    return [node], {f"{name}_w": weights[:, :3, None, None].copy(), f"{name}_b": weights[:, 3].copy()}


def given(name: str, value: np.ndarray) -> tuple[list[Any], dict[str, np.ndarray]]:
    return [onnx.helper.make_node("Identity", [f"{name}_c"], [name])], {f"{name}_c": value}


def joined(*parts: tuple[list[Any], dict[str, np.ndarray]]) -> tuple[list[Any], dict[str, np.ndarray]]:
    return [n for nodes, _ in parts for n in nodes], {k: v for _, constants in parts for k, v in constants.items()}


def panoptic_network(path: Path, classes: int = 133, size: Any = (24, 32), **options: Any) -> Path:
    """Query 0: chair where it is red; 1 and 2: wall where it is blue, above and where it is black; 3: nothing."""
    logits = np.full((1, 4, classes + 1), -20, dtype=np.float32)
    wall = 131 if classes == 133 else 1
    for query, number in enumerate((56 if classes == 133 else 0, wall, wall, classes)):
        logits[0, query, number] = 20
    # Before it comes here, red is (1 - 0.485) / 0.229 and no red -0.485 / 0.229: 2.25 and -2.12; blue 2.64 and -1.80.
    masks = colored("masks", [[5, 0, -5, -5], [-5, 0, 5, -5], [-5, 0, -5, -15], [0, 0, 0, 30]])
    nodes, constants = joined(given("classes", logits), masks)
    outputs = {"classes": [1, 4, classes + 1], "masks": [1, 4, "h", "w"]}
    return save(path, nodes, outputs, constants, size, **options)


def yolo_network(path: Path, classes: int = 80, metadata: dict[str, str] | None = None) -> Path:
    """Two prototypes: red and blue. Boxes: a cup where it is red (twice), a chair where it is blue, unsure ones."""
    rows = np.zeros((1, 4 + classes + 2, 200), dtype=np.float32)
    for k, (box, number, score, coefficients) in enumerate(
        (
            ((16, 24, 32, 48), 41, 0.9, (8, -8)),
            ((17, 24, 32, 48), 41, 0.8, (8, -8)),
            ((48, 24, 32, 24), 56, 0.7, (-8, 8)),
            ((32, 24, 64, 48), 0, 0.1, (8, 8)),
            ((32, 24, 64, 48), 0, np.nan, (8, 8)),
        )
    ):
        rows[0, :4, k], rows[0, 4 + number % classes, k], rows[0, -2:, k] = box, score, coefficients
    nodes, constants = joined(given("output0", rows), colored("output1", [[2, 0, 0, -1], [0, 0, 2, -1]]))
    outputs = {"output0": list(rows.shape), "output1": [1, 2, "h", "w"]}
    return save(path, nodes, outputs, constants, (64, 64), metadata)


def mask_rcnn_network(path: Path, *, whole: bool) -> Path:
    """A cup and a person under the threshold; masks of the whole input, or small ones for their boxes."""
    boxes = np.array([[8, 4, 24, 20], [0, 0, 60, 40]], dtype=np.float32)
    scores = np.array([0.8, 0.1], dtype=np.float32)
    masks = np.zeros((2, 1, HEIGHT, WIDTH) if whole else (2, 1, 8, 8), dtype=np.float32)
    if whole:
        masks[0, 0, 4:12, 8:24] = 1
    else:
        masks[0, 0, :4] = 1  # the upper half of the box
    labels = ("labels" if whole else "pred_classes", np.array([47, 1] if whole else [41, 0], dtype=np.int64))
    names = ("boxes", "masks") if whole else ("pred_boxes", "pred_masks")
    nodes, constants = joined(
        given(names[0], boxes), given(labels[0], labels[1]), given("scores", scores), given(names[1], masks)
    )
    kinds = {names[0]: [2, 4], "scores": [2], names[1]: list(masks.shape)}
    path = save(path, nodes, {**kinds, "labels": [2]} if whole else kinds, constants, ("h", "w"), batch=not whole)
    if not whole:
        model = onnx.load(str(path))
        model.graph.output.append(onnx.helper.make_tensor_value_info("pred_classes", onnx.TensorProto.INT64, [2]))
        onnx.save(model, str(path))
    return path


def found_by(weights: Path, color: np.ndarray | None = None, **inputs: Any) -> tuple[Any, Any]:
    options = inputs.pop("options", {})
    request = BackendRequest(SegmentParameters(backend="onnx", **options), weights, **inputs)
    made: Any = choose_backend(request)
    geometric: Any = SimpleNamespace(labels=np.zeros((HEIGHT, WIDTH), dtype=np.int32))
    frame = Frame(0, 0.0, image() if color is None else color, None, None, None)
    return made, made(frame, geometric, np.random.default_rng(0))


def pixels_of(frame: Any, name: str) -> np.ndarray:
    wanted = [k for k, mask in frame.masks.items() if VOCABULARY.by_id(mask.class_id).name == name]
    return np.isin(frame.ids, wanted)


def test_panoptic(tmp_path: Path) -> None:
    made, frame = found_by(panoptic_network(tmp_path / "panoptic.onnx"))
    assert made.label == "onnx panoptic (panoptic, coco-panoptic)" and made.name == "onnx"
    colors = image()
    for name, true in (("chair", colors[..., 0] > 0), ("wall", colors[..., 0] == 0)):
        found = pixels_of(frame, name)
        assert (found & true).sum() / (found | true).sum() > 0.9, name
    assert len(frame.masks) == 2 and all(mask.score > 0.99 for mask in frame.masks.values())
    _, blind = found_by(tmp_path / "panoptic.onnx", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert pixels_of(blind, "wall").all()


def test_panoptic_of_any_size_with_a_sidecar(tmp_path: Path) -> None:
    weights = panoptic_network(tmp_path / "net.onnx", classes=2, size=("h", "w"))
    with pytest.raises(BadInput, match="nothing says what its 2 classes are"):
        found_by(weights)
    sidecar = tmp_path / "net.toml"
    sidecar.write_text(
        'layout = "panoptic"\nlabels = ["table-merged", "wall-brick"]\nmean = [0.485, 0.456, 0.406]\n'
        'deviation = [0.229, 0.224, 0.225]\n[outputs]\nclasses = "classes"\nmasks = "masks"\n'
    )
    _, frame = found_by(weights, sidecar=sidecar)
    assert np.array_equal(pixels_of(frame, "table"), image()[..., 0] > 0)  # nothing was scaled
    assert np.array_equal(pixels_of(frame, "wall"), image()[..., 0] == 0)
    # The wrong order of the channels is seen in the result: blue is red.
    sidecar.write_text(sidecar.read_text().replace("[outputs]", 'order = "bgr"\n[outputs]'))
    _, swapped = found_by(weights, sidecar=sidecar)
    assert pixels_of(swapped, "table")[0, -1] and not pixels_of(swapped, "table")[0, 0]


def test_yolo(tmp_path: Path) -> None:
    made, frame = found_by(yolo_network(tmp_path / "yolo.onnx"))
    assert made.label == "onnx yolo (yolo-seg, coco-80)"
    names = sorted(VOCABULARY.by_id(mask.class_id).name for mask in frame.masks.values())
    assert names == ["chair", "cup"]  # one cup, though it was boxed twice
    cup, chair = pixels_of(frame, "cup"), pixels_of(frame, "chair")
    expected = np.zeros((2, HEIGHT, WIDTH), dtype=bool)
    expected[0, :36, :32], expected[1, 12:36, 32:] = True, True  # the box of the chair begins lower than the blue
    for found, true in zip((cup, chair), expected, strict=True):
        assert (found & true).sum() / (found | true).sum() > 0.95
    assert sorted(round(mask.score, 3) for mask in frame.masks.values()) == [0.7, 0.9]


def test_names_in_the_metadata_go_before_positions(tmp_path: Path) -> None:
    names = str({k: "bottle" if k == 41 else "sofa" if k == 56 else f"thing {k}" for k in range(80)})
    made, frame = found_by(yolo_network(tmp_path / "a.onnx", metadata={"names": names}))
    found = sorted(VOCABULARY.by_id(mask.class_id).name for mask in frame.masks.values())
    assert found == ["bottle", "sofa"] and "scenewright" in made.label
    for text in ("__import__('os')", "{", "[" * 5000, "3"):
        _, frame = found_by(yolo_network(tmp_path / "b.onnx", metadata={"names": text}))
        assert pixels_of(frame, "cup").any()  # not names: the number of classes tells


@pytest.mark.parametrize("whole", [True, False])
def test_mask_rcnn(tmp_path: Path, whole: bool) -> None:
    made, frame = found_by(mask_rcnn_network(tmp_path / "rcnn.onnx", whole=whole))
    assert made.label == "onnx rcnn (instances, coco-80)"
    expected = np.zeros((HEIGHT, WIDTH), dtype=bool)
    expected[4:12, 8:24] = True
    assert np.array_equal(pixels_of(frame, "cup"), expected) and len(frame.masks) == 1


def test_small_masks_fill_their_boxes() -> None:
    mask = _paste_mask(np.ones((4, 4), np.float32), (-5.0, 2.0, 6.5, 30.0), (20, 30))
    expected = np.zeros((20, 30), dtype=bool)
    expected[2:, :7] = True
    assert np.array_equal(mask, expected)
    assert not _paste_mask(np.ones((4, 4), np.float32), (3.0, 3.0, 3.0, 9.0), (20, 30)).any()
    assert not _paste_mask(np.ones((4, 4), np.float32), (40.0, 3.0, 50.0, 9.0), (20, 30)).any()


def test_fitting() -> None:
    sidecar = Sidecar(layout="yolo-seg", outputs={}, resize="letterbox", scale=1.0)
    fitted = fit(image(), sidecar, (128, 128))
    assert fitted.tensor.shape == (1, 3, 128, 128) and fitted.scale_x == fitted.scale_y == 2.0
    assert (fitted.tensor[0, :, 96:] == 114).all() and fitted.tensor[0, 0, 10, 10] == 255
    stretched = fit(image(), sidecar.model_copy(update={"resize": "stretch", "order": "bgr", "batch": False}), (32, 12))
    assert stretched.tensor.shape == (3, 12, 32) and (stretched.scale_x, stretched.scale_y) == (0.5, 0.25)
    assert stretched.tensor[2, 2, 2] == 255 and stretched.tensor[0, 2, 2] == 0


def test_layouts() -> None:
    assert find_layout({"a": (1, 116, 8400), "b": (1, 32, 160, 160)}).layout == "yolo-seg"  # type: ignore[union-attr]
    assert find_layout({"a": (1, 100, 134), "b": (1, 100, 96, 96)}).layout == "panoptic"  # type: ignore[union-attr]
    assert find_layout({"a": (1, 84, 8400)}) is None and find_layout({"a": (1, 5), "b": (1, 5)}) is None


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(MissingDependency, match="needs a network"):
        choose_backend(BackendRequest(SegmentParameters(backend="onnx")))
    (tmp_path / "empty").mkdir()
    garbage = tmp_path / "garbage.onnx"
    garbage.write_bytes(b"\x08\x07garbage")
    sound = panoptic_network(tmp_path / "sound.onnx")
    torn = tmp_path / "torn.onnx"
    torn.write_bytes(sound.read_bytes()[:300])
    nodes, constants = colored("only", [[1, 0, 0, 0]])
    odd = save(tmp_path / "odd.onnx", nodes, {"only": [1, 1, "h", "w"]}, constants, (8, 8))
    for weights, text in (
        (garbage, "no ONNX network"),
        (torn, "no ONNX network"),
        (odd, "no known layout"),
        (tmp_path / "empty", "holds no network"),
    ):
        with pytest.raises(BadInput, match=text) as caught:
            found_by(weights)
        assert "\n" not in str(caught.value)
    sidecar = tmp_path / "sidecar.toml"
    good = 'layout = "panoptic"\nlabels = "coco-panoptic"\n[outputs]\nclasses = "classes"\nmasks = "masks"\n'
    for change, text in (
        (('"panoptic"\n', '"boxes"\n'), "layout"),
        (('masks = "masks"', ""), "outputs are"),
        (('masks = "masks"', 'masks = "mask"'), "no output 'mask'"),
        (('"coco-panoptic"', '"imagenet"'), "no label set"),
        (('"coco-panoptic"', '"ade20k"'), "has 133 classes, ade20k has 150"),
        (("layout", "layuot"), "layuot|layout"),
        (("[outputs]", "size = [0, 3]\n[outputs]"), "size"),
        (("[outputs]", "scale = 0.0\n[outputs]"), "of 0"),
        (("[outputs]", "deviation = [1.0, 0.0, 1.0]\n[outputs]"), "of 0"),
        ((good, "= ="), "line 1|Invalid"),
    ):
        sidecar.write_text(good.replace(*change))
        with pytest.raises(BadInput, match=text):
            found_by(sound, sidecar=sidecar)
    sidecar.write_text(good)
    assert read_sidecar(sidecar).labels == "coco-panoptic"
    _, frame = found_by(sound, sidecar=sidecar)
    assert frame.masks is not None
