"""ONNX files as exporters write them: which are read, and that what a refusal says works when it is followed."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.networks.fitting import STEP
from scenewright.stages.segment.networks.onnx_network import OnnxNetwork
from scenewright.stages.segment.networks.sidecar import find_layout, misfit, only_boxes, read_sidecar

from tests.unit.segment import test_onnx as known
from tests.unit.segment.test_onnx import HEIGHT, WIDTH, colored, found_by, given, image, joined, pixels_of, save

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

NAMES = {"names": str({0: "cup", 1: "chair"})}


def check_cup_and_chair(frame: Any) -> None:
    """A cup where it is red, a chair where it is blue, from row 12 on."""
    expected = np.zeros((2, HEIGHT, WIDTH), dtype=bool)
    expected[0, :36, :32], expected[1, 12:36, 32:] = True, True
    for name, true in zip(("cup", "chair"), expected, strict=True):
        found = pixels_of(frame, name)
        assert (found & true).sum() / (found | true).sum() > 0.95, name
    assert len(frame.masks) == 2


def end_to_end(path: Path, count: int = 300, coefficients: int = 2, **options: Any) -> Path:
    """Boxes by their corners, score, class, coefficients: a cup, a chair, a faint and a broken one, and padding."""
    rows = np.zeros((1, count, 6 + coefficients), dtype=np.float32)
    rows[0, 0] = [0, 0, 32, 48, 0.9, 0, 8, -8]
    rows[0, 1] = [32, 12, 64, 36, 0.7, 1, -8, 8]
    rows[0, 2] = [0, 0, 64, 48, 0.1, 1, 8, 8]
    rows[0, 3] = [0, 0, 64, 48, np.nan, 1, 8, 8]
    nodes, constants = joined(given("output0", rows), colored("output1", [[2, 0, 0, -1], [0, 0, 2, -1]]))
    outputs = {"output0": list(rows.shape), "output1": [1, 2, "h", "w"]}
    size = options.pop("size", (64, 64))
    return save(path, nodes, outputs, constants, size, options.pop("metadata", NAMES), **options)


def with_objectness(path: Path, metadata: dict[str, str], classes: int = 2) -> Path:
    """Rows of box, objectness, classes, coefficients: a cup and a chair, and one sure of a class but of no thing."""
    rows = np.zeros((1, 252, 5 + classes + 2), dtype=np.float32)
    rows[0, 0, [0, 1, 2, 3, 4, 5]], rows[0, 0, -2:] = [16, 24, 32, 48, 0.9, 1], [8, -8]
    rows[0, 1, [0, 1, 2, 3, 4, 6]], rows[0, 1, -2:] = [48, 24, 32, 24, 0.9, 0.8], [-8, 8]
    rows[0, 2, [0, 1, 2, 3, 4, 5]], rows[0, 2, -2:] = [32, 24, 64, 48, 0.01, 1], [8, 8]
    nodes, constants = joined(given("output0", rows), colored("output1", [[2, 0, 0, -1], [0, 0, 2, -1]]))
    outputs = {"output0": list(rows.shape), "output1": [1, 2, "h", "w"]}
    return save(path, nodes, outputs, constants, (64, 64), metadata)


def test_yolo_with_objectness(tmp_path: Path) -> None:
    made, frame = found_by(with_objectness(tmp_path / "v5.onnx", NAMES))
    assert made.label == "onnx v5 (yolo-objectness, scenewright)"
    check_cup_and_chair(frame)
    assert sorted(round(mask.score, 3) for mask in frame.masks.values()) == [0.72, 0.9]


def test_yolo_with_objectness_without_names_follows_the_advice(tmp_path: Path) -> None:
    weights = with_objectness(tmp_path / "v5.onnx", {})
    with pytest.raises(BadInput, match="nothing says what its 2 classes are") as caught:
        found_by(weights)
    sidecar = tmp_path / "net.toml"
    lines = (caught.value.hint or "").split(" with ")[1].replace('"chair", ...', '"cup", "chair"')
    sidecar.write_text(lines.replace(", labels", "\nlabels").replace(", outputs", "\noutputs"))
    check_cup_and_chair(found_by(weights, sidecar=sidecar)[1])


def test_yolo_end_to_end(tmp_path: Path) -> None:
    made, frame = found_by(end_to_end(tmp_path / "e2e.onnx"))
    assert made.label == "onnx e2e (yolo-end-to-end, scenewright)"
    check_cup_and_chair(frame)
    assert sorted(round(mask.score, 3) for mask in frame.masks.values()) == [0.7, 0.9]


def test_yolo_end_to_end_without_names_follows_the_advice(tmp_path: Path) -> None:
    weights = end_to_end(tmp_path / "e2e.onnx", metadata={})
    with pytest.raises(BadInput, match="nothing says what its classes are") as caught:
        found_by(weights)
    hint = caught.value.hint or ""
    assert 'layout = "yolo-end-to-end"' in hint
    lines = hint.split(" with ")[1].replace('"chair", ...', '"cup", "chair"').replace(", labels", "\nlabels")
    sidecar = tmp_path / "net.toml"
    sidecar.write_text(lines.replace(", outputs", "\noutputs"))
    check_cup_and_chair(found_by(weights, sidecar=sidecar)[1])
    assert 'labels = ["cup", "chair"]' in sidecar.read_text()
    sidecar.write_text(sidecar.read_text().replace("yolo-end-to-end", "yolo-seg"))
    with pytest.raises(BadInput, match=r"gives predictions \(1, 300, 8\).*these are the shapes of yolo-end-to-end"):
        found_by(weights, sidecar=sidecar)


def test_a_sidecar_says_only_what_is_not_as_usual(tmp_path: Path) -> None:
    """The input that the table of layouts names holds without being repeated."""
    sidecar = tmp_path / "a.toml"
    for layout, roles in (("yolo-seg", ("predictions", "prototypes")), ("panoptic", ("classes", "masks"))):
        outputs = "\n".join(f'{role} = "{role}"' for role in roles)
        sidecar.write_text(f'layout = "{layout}"\n[outputs]\n{outputs}\n')
        read = read_sidecar(sidecar)
        assert read.resize == ("letterbox" if layout == "yolo-seg" else "stretch")
        assert read.mean == ((0.0, 0.0, 0.0) if layout == "yolo-seg" else (0.485, 0.456, 0.406))


@pytest.mark.parametrize(("size", "imgsz"), [(("h", "w"), None), (("h", "w"), "[64, 96]"), ((64, 64), "[32, 32]")])
def test_networks_of_any_size_get_a_size_that_they_can_take(tmp_path: Path, size: Any, imgsz: str | None) -> None:
    metadata = {**NAMES, **({"imgsz": imgsz} if imgsz else {})}
    weights = end_to_end(tmp_path / "e2e.onnx", size=size, metadata=metadata)
    network = OnnxNetwork(weights, None, "cpu")
    fitted = network.fit(image())
    expected = (64, 64) if imgsz is None or size[0] == 64 else (64, 96)
    assert fitted.tensor.shape[-2:] == expected and all(side % STEP == 0 for side in expected)


def half_precision(path: Path) -> None:
    """As `half=True` writes it: the image is of 16 bits."""
    model = onnx.load(str(path))
    model.graph.input[0].type.tensor_type.elem_type = onnx.TensorProto.FLOAT16
    model.graph.node.insert(0, onnx.helper.make_node("Cast", ["image"], ["whole"], to=onnx.TensorProto.FLOAT))
    for node in list(model.graph.node)[1:]:
        node.input[:] = ["whole" if name == "image" else name for name in node.input]
    onnx.save(model, str(path))


def test_sixteen_bits_are_read(tmp_path: Path) -> None:
    weights = end_to_end(tmp_path / "half.onnx")
    half_precision(weights)
    check_cup_and_chair(found_by(weights)[1])


def of_several_pictures(path: Path) -> None:
    model = onnx.load(str(path))
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 4
    onnx.save(model, str(path))


def test_inputs_that_are_not_one_picture(tmp_path: Path) -> None:
    weights = end_to_end(tmp_path / "net.onnx")
    of_several_pictures(weights)
    with pytest.raises(BadInput, match="takes 4 images at a time") as caught:
        found_by(weights)
    assert "batch=1" in (caught.value.hint or "")
    sidecar = tmp_path / "net.toml"
    told = 'layout = "yolo-end-to-end"\nsize = [32, 32]\n[outputs]\npredictions = "output0"\nprototypes = "output1"\n'
    sidecar.write_text(told)
    weights = end_to_end(tmp_path / "net.onnx")
    with pytest.raises(BadInput, match=r"takes images of \(64, 64\), the sidecar says \(32, 32\)") as caught:
        found_by(weights, sidecar=sidecar)
    assert caught.value.hint == "leave `size` out of the sidecar"
    sidecar.write_text(told.replace("size = [32, 32]\n", ""))
    check_cup_and_chair(found_by(weights, sidecar=sidecar)[1])


def test_queries_of_rf_detr(tmp_path: Path) -> None:
    classes = np.full((1, 4, 91), -9, dtype=np.float32)
    classes[0, 0, 47], classes[0, 1, 62], classes[0, 2, 47] = 3, 2, -2  # COCO's ids of cup and chair
    # Red is 2.25 and no red -2.12 where the input is normalised as ImageNet's; blue 2.64 and -1.80.
    masks = colored("masks", [[5, 0, 0, -1], [0, 0, 5, -1], [0, 0, 0, 9], [0, 0, 0, 9]])
    boxes = np.zeros((1, 4, 4), dtype=np.float32)
    parts = joined(given("dets", boxes), given("logits", classes), masks)
    outputs = {"dets": [1, 4, 4], "logits": [1, 4, 91], "masks": [1, 4, "h", "w"]}
    weights = save(tmp_path / "rfdetr.onnx", *_ordered(parts, outputs), (HEIGHT, WIDTH))
    _rename(weights, "logits", "labels")
    made, frame = found_by(weights)
    assert "query-instances" in made.label and len(frame.masks) == 2
    assert np.array_equal(pixels_of(frame, "cup"), image()[..., 0] > 0)
    assert np.array_equal(pixels_of(frame, "chair"), image()[..., 2] > 0)


def _ordered(parts: Any, outputs: dict[str, list[Any]]) -> tuple[Any, dict[str, list[Any]], Any]:
    return parts[0], outputs, parts[1]


def _rename(path: Path, old: str, new: str) -> None:
    model = onnx.load(str(path))
    for node in model.graph.node:
        node.output[:] = [new if name == old else name for name in node.output]
    for output in model.graph.output:
        output.name = new if output.name == old else output.name
    onnx.save(model, str(path))


@pytest.mark.parametrize("named", [True, False])
def test_boxes_with_their_score_as_a_fifth_column(tmp_path: Path, named: bool) -> None:
    """MMDeploy's Mask R-CNN; under names that say nothing a sidecar tells the roles."""
    boxes = np.array([[8, 4, 24, 20, 0.8], [0, 0, 60, 40, 0.1]], dtype=np.float32)[None]
    masks = np.zeros((1, 2, HEIGHT, WIDTH), dtype=np.float32)
    masks[0, 0, 4:12, 8:24] = 1
    parts = joined(given("dets", boxes), given("labels", np.array([[41, 0]])), given("masks", masks))
    outputs = {"dets": [1, 2, 5], "labels": [1, 2], "masks": [1, 2, HEIGHT, WIDTH]}
    weights = save(tmp_path / "rcnn.onnx", *_ordered(parts, outputs), (HEIGHT, WIDTH))
    sidecar = tmp_path / "net.toml"
    if not named:
        for name, number in (("dets", "812"), ("labels", "813"), ("masks", "814")):
            _rename(weights, name, number)
        with pytest.raises(BadInput, match="no known layout") as caught:
            found_by(weights)
        assert "boxes (N, 4 or 5), labels (N,)" in (caught.value.hint or "")
        sidecar.write_text(
            'layout = "instances"\nlabels = "coco-80"\n[outputs]\nboxes = "812"\nlabels = "813"\nmasks = "814"\n'
        )
    _, frame = found_by(weights, **({} if named else {"sidecar": sidecar}))
    expected = np.zeros((HEIGHT, WIDTH), dtype=bool)
    expected[4:12, 8:24] = True
    assert np.array_equal(pixels_of(frame, "cup"), expected) and len(frame.masks) == 1


def test_classes_that_are_only_guessed_are_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    weights = known.mask_rcnn_network(tmp_path / "rcnn.onnx", whole=False)
    with caplog.at_level(logging.INFO, "scenewright"):
        found_by(weights)
    assert "its outputs name no classes, taken for those of coco-80" in caplog.text
    model = onnx.load(str(weights))
    model.metadata_props.add(key="names", value=str({41: "chair", 0: "cup"}))
    onnx.save(model, str(weights))
    _, frame = found_by(weights)
    assert pixels_of(frame, "chair").any() and not pixels_of(frame, "cup").any()


def test_layouts_by_their_shapes() -> None:
    for shapes, layout, classes in (
        ({"a": (1, 300, 38), "b": (1, 32, 160, 160)}, "yolo-end-to-end", 1),
        ({"a": (1, 3000, 38), "b": (1, 32, 160, 160)}, "yolo-end-to-end", 80),
        ({"a": (1, 25200, 38), "b": (1, 32, 160, 160)}, "yolo-objectness", 1),
        ({"a": (1, 25200, 117), "b": (1, 32, 160, 160)}, "yolo-objectness", 0),
        ({"a": (1, 84, 117), "b": (1, 32, 160, 160)}, "yolo-objectness", 80),
        ({"a": (1, 20, 38), "b": (1, 32, 160, 160)}, "yolo-end-to-end", 0),
        ({"a": (1, 39, 8400), "b": (1, 32, 160, 160)}, "yolo-seg", 0),
        ({"a": (1, 100, 134), "b": (1, 100, 96, 96)}, "panoptic", 0),
        ({"logits": (1, 100, 251), "pred_boxes": (1, 100, 4), "pred_masks": (1, 100, 200, 267)}, "panoptic", 0),
        ({"dets": (1, 200, 4), "labels": (1, 200, 91), "masks": (1, 200, 108, 108)}, "query-instances", 0),
    ):
        sidecar = find_layout(shapes, classes)
        assert sidecar is not None and sidecar.layout == layout
        assert misfit(layout, {role: shapes[name] for role, name in sidecar.outputs.items()}) == ""
    shapes = {"predictions": (1, 39, 8400), "prototypes": (1, 32, 160, 160)}
    assert misfit("yolo-end-to-end", shapes) == "these are the shapes of yolo-seg"
    assert "classes (1, Q, C+1)" in misfit("panoptic", {"classes": (1, 9, 3), "masks": (1, 8, 4, 4)})


@pytest.mark.parametrize(
    "shapes",
    [
        {"output0": (1, 300, 6)},
        {"output0": (1, 84, 8400)},
        {"output0": (1, 300, 84)},
        {"logits": (1, 300, 80), "pred_boxes": (1, 300, 4)},
        {"dets": (1, 300, 4), "labels": (1, 300, 91)},
        {"boxes": (7, 4), "labels": (7,), "scores": (7,)},
        {"dets": (1, 100, 5), "labels": (1, 100)},
    ],
)
def test_networks_that_give_boxes_alone_are_named(shapes: dict[str, tuple[int, ...]]) -> None:
    assert only_boxes(shapes) and find_layout(shapes) is None
    assert not only_boxes({"a": (1, 39, 8400), "b": (1, 32, 160, 160)}) and not only_boxes({"a": (1, 21, 64, 64)})


@pytest.mark.parametrize(
    ("shape", "message", "hint"),
    [
        ((1, 300, 6), r"gives boxes without masks \(output0 \(1, 300, 6\)\)", "yolo11n-seg.pt"),
        ((1, 3, 8, 8), "nothing says what its 3 classes are", 'layout = "semantic"'),
        ((1, 7), "of no known layout", "--backend masks"),
    ],
)
def test_refusals_name_a_way(tmp_path: Path, shape: tuple[int, ...], message: str, hint: str) -> None:
    nodes, constants = given("output0", np.zeros(shape, dtype=np.float32))
    weights = save(tmp_path / "net.onnx", nodes, {"output0": list(shape)}, constants, (8, 8))
    with pytest.raises(BadInput, match=message) as caught:
        found_by(weights)
    assert hint in (caught.value.hint or "") and "\n" not in str(caught.value)


def test_the_raw_export_is_read_as_before(tmp_path: Path) -> None:
    _, frame = found_by(known.yolo_network(tmp_path / "raw.onnx"))
    check_cup_and_chair(frame)
