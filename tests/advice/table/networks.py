"""Networks and services that `segment` asks: ONNX, transformers, the detector, a service."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.cli.segmentation_server import open_server
from scenewright.schemas.segments import Segments
from scenewright.stages.kit.services.segmentation_client import read_info
from scenewright.stages.segment.backends.service import ServiceParameters
from scenewright.stages.segment.backends.service.backend import connected

from tests.advice.inputs import flags, server, service
from tests.advice.rows import Tried
from tests.real_data import real_data
from tests.strangers.pictures import RED_AND_BLUE, classes_at

BACKENDS = "stages/segment/backends"
NETWORKS, CHOICE = "stages/segment/networks", "stages/segment/choice.py"
PICTURES, LABELLING, NETWORK = f"{NETWORKS}/pictures.py", f"{NETWORKS}/labelling.py", f"{NETWORKS}/sidecar.py"
HUGGING, SERVICE = f"{BACKENDS}/huggingface/backend.py", f"{BACKENDS}/service/backend.py"
DETECTOR, YOLOX = f"{BACKENDS}/detector/backend.py", f"{BACKENDS}/detector/yolox.py"
SEGMENT = "segment --sequence {flags} --out out"
BY_ONNX = f"{SEGMENT} --backend onnx"
BY_MODEL = f"{SEGMENT} --backend huggingface --score-threshold 0.01 --accept empty"
DINO, PANOPTIC = "--weights {models}/grounding_dino", "--weights {models}/mask2former"
DETECTING = f"{SEGMENT} --backend detector --tiles 0 --accept empty"
BY_SERVICE = "SCENEWRIGHT_REPLIES=kept segment --sequence {flags} --out out --backend {service} --retries 0"
PREDICTIONS = (
    'layout = "yolo-seg"\nlabels = {labels}\noutputs = {{ predictions = "output0", prototypes = "output1" }}\n'
)


def tiny() -> Any:
    """Return the module that makes tiny networks; skip without what it needs."""
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    from tests.unit.segment import test_onnx

    return test_onnx


def yolo(folder: Path) -> None:
    """A YOLO that finds a cup where it is red and a chair where it is blue."""
    tiny().yolo_network(folder / "yolo.onnx")


def of_two_classes(folder: Path) -> None:
    tiny().yolo_network(folder / "yolo.onnx", classes=2)  # 41 and 56 are 1 and 0 of two
    (folder / "net.toml").write_text(PREDICTIONS.format(labels=json.dumps(["chair", "cup"])))


def of_other_classes(folder: Path) -> None:
    """Eighty classes which are not COCO's: what those call a cup is a chair."""
    yolo(folder)
    names = ["object"] * 80
    names[41], names[56] = "chair", "cup"
    (folder / "net.toml").write_text(PREDICTIONS.format(labels=json.dumps(names)))


def with_a_third_output(folder: Path) -> None:
    import onnx

    yolo(folder)
    model = onnx.load(str(folder / "yolo.onnx"))
    nodes, constants = tiny().given("more", np.zeros((1, 5), np.float32))
    model.graph.node.extend(nodes)
    model.graph.initializer.extend(onnx.numpy_helper.from_array(value, name) for name, value in constants.items())
    model.graph.output.append(onnx.helper.make_tensor_value_info("more", onnx.TensorProto.FLOAT, [1, 5]))
    onnx.save(model, str(folder / "yolo.onnx"))
    (folder / "net.toml").write_text(PREDICTIONS.format(labels='"coco-80"'))


def write_masks(folder: Path) -> None:
    """What a script of one's own writes: red is a cup, blue a chair."""
    (folder / "masks").mkdir()
    for index, (color, _, _) in enumerate(RED_AND_BLUE):
        ids = (color[..., 0] > 0) + 2 * (color[..., 2] > 0).astype(np.uint8)
        assert cv2.imwrite(str(folder / f"masks/{index:06d}.png"), ids)
    (folder / "masks/classes.json").write_text(json.dumps({"1": "cup", "2": "chair"}))


def of_two_inputs(folder: Path) -> None:
    import onnx

    yolo(folder)
    model = onnx.load(str(folder / "yolo.onnx"))
    model.graph.input.append(onnx.helper.make_tensor_value_info("size", onnx.TensorProto.FLOAT, [2]))
    onnx.save(model, str(folder / "yolo.onnx"))
    write_masks(folder)


def boxes_alone(folder: Path) -> None:
    yolo(folder)
    nodes, constants = tiny().given("output0", np.zeros((1, 84, 200), np.float32))
    tiny().save(folder / "boxes.onnx", nodes, {"output0": [1, 84, 200]}, constants, (64, 64))


def with_a_class_a_pixel(folder: Path) -> None:
    """A YOLO, and a semantic network with VOC's classes: what is red is a bottle, what is blue a chair."""
    yolo(folder)
    rows = [[0, 0, 0, 0.0]] * 21
    rows[5], rows[9] = [1, 0, -1, -1], [-1, 0, 1, -1]
    nodes, constants = tiny().colored("scores", rows)
    tiny().save(folder / "voc.onnx", nodes, {"scores": [1, 21, 64, 64]}, constants, (64, 64))


def in_a_folder(folder: Path) -> None:
    """A network of two classes in a folder, with its sidecar beside it, and that sidecar by itself."""
    (folder / "nets").mkdir()
    of_two_classes(folder / "nets")
    shutil.copy(folder / "nets/net.toml", folder / "net.toml")
    (folder / "nets/net.toml").rename(folder / "nets/yolo.toml")


def words(folder: Path) -> None:
    (folder / "words.txt").write_text("cup\ntable\n")


def detectors(folder: Path) -> None:
    """The published YOLOX and DeepLab, and files that are none; skip where those are not."""
    shutil.copy(real_data("detectors") / "yolox_nano.onnx", folder / "yolox.onnx")
    shutil.copy(
        real_data("detectors") / "deeplab_voc_tflite/deeplabv3_mnv2_dm05_pascal_quant.tflite", folder / "deeplab.tflite"
    )
    for name in ("broken.onnx", "broken.tflite"):
        (folder / name).write_bytes(b"no network")


def cup_and_chair(folder: Path) -> None:
    found = classes_at(folder / "out")
    assert min(found) > 0.5, found


def bottle_and_chair(folder: Path) -> None:
    found = classes_at(folder / "out", red="bottle", blue="chair")
    assert min(found) > 0.5, found


def chair_and_cup(folder: Path) -> None:
    found = classes_at(folder / "out", red="chair", blue="cup")
    assert min(found) > 0.5, found


def labelled(text: str) -> Callable[[Path], None]:
    """Return a check of whose masks they are."""

    def check(folder: Path) -> None:
        label = Segments(folder / "out").info.label
        assert text in label, label

    return check


def asked(*options: str, fails_at: int = 1000) -> Callable[[], int]:
    """Return what segments `flags` by the service, which fails from a request on."""

    def segment() -> int:
        served = server()
        answer, served.requests = served.answer, 0
        served.answer = lambda number: (500, {}, b"") if number >= fails_at else answer(number)
        try:
            with mock.patch.dict(os.environ, {"SCENEWRIGHT_REPLIES": "kept"}):
                return run(["segment", f"--sequence={flags()}", "--out=out", f"--backend={service()}", *options])
        finally:
            served.answer = answer

    return segment


def by_its_own_name() -> int:
    connection = connected(service(), ServiceParameters())
    return asked("--service-model", read_info(connection).identity)()


def serve(backend: str) -> Callable[[], str]:
    """Return what opens the server of `scenewright models serve`, and closes it."""

    def opened() -> str:
        made = open_server({"backend": backend}, {})
        made.server_close()
        return "serves"

    return opened


ROWS = [
    Tried(
        PICTURES, "needs a network", BY_ONNX, f"{BY_ONNX} --weights yolo.onnx", code=5, given=yolo, right=cup_and_chair
    ),
    Tried(
        LABELLING,
        "nothing says what its",
        f"{BY_ONNX} --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx --sidecar net.toml",
        code=3,
        given=of_two_classes,
        right=cup_and_chair,
    ),
    Tried(
        LABELLING,
        "taken for those of",
        f"{BY_ONNX} --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx --sidecar net.toml",
        code=0,
        given=of_other_classes,
        right=chair_and_cup,
    ),
    Tried(
        NETWORK,
        "say what goes in and what comes out",
        f"{BY_ONNX} --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx --sidecar net.toml",
        code=3,
        given=with_a_third_output,
        right=cup_and_chair,
    ),
    Tried(
        NETWORK,
        "run it in a script of your own and give its masks",
        f"{BY_ONNX} --weights yolo.onnx",
        f"{SEGMENT} --backend masks --masks masks",
        code=3,
        given=of_two_inputs,
        right=cup_and_chair,
    ),
    Tried(
        NETWORK,
        "gives boxes without masks",
        f"{BY_ONNX} --weights boxes.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        code=3,
        given=boxes_alone,
        right=cup_and_chair,
    ),
    Tried(
        CHOICE,
        "--sidecar is for one network",
        f"{BY_ONNX} --weights nets --sidecar net.toml",
        f"{BY_ONNX} --weights nets",
        code=2,
        given=in_a_folder,
        right=cup_and_chair,
    ),
    Tried(
        CHOICE,
        "--{} is for --backend {}",
        f"{SEGMENT} --backend geometric --semantic-weights voc.onnx",
        f"{BY_ONNX} --semantic-weights voc.onnx",
        code=2,
        given=with_a_class_a_pixel,
        right=bottle_and_chair,
    ),
    Tried(
        "stages/segment/registry.py",
        "several networks of one backend are a folder of --weights",
        f"{SEGMENT} --backend onnx+onnx --weights nets",
        f"{BY_ONNX} --weights nets",
        code=2,
        given=in_a_folder,
        right=cup_and_chair,
    ),
    Tried(
        PICTURES,
        "--tiles is for networks that give instances",
        f"{BY_ONNX} --weights voc.onnx --tiles 2",
        f"{BY_ONNX} --weights voc.onnx",
        code=2,
        given=with_a_class_a_pixel,
        right=bottle_and_chair,
    ),
    Tried(
        PICTURES,
        "--semantic-weights does so too",
        f"{BY_ONNX} --weights voc.onnx --semantic-weights voc.onnx",
        f"{BY_ONNX} --weights yolo.onnx --semantic-weights voc.onnx",
        code=3,
        given=with_a_class_a_pixel,
        right=cup_and_chair,
    ),
    Tried(
        PICTURES,
        "takes .{} files",
        f"{SEGMENT} --backend tflite --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        code=3,
        given=yolo,
        right=cup_and_chair,
    ),
    Tried(
        PICTURES,
        "give --backend {}",
        f"{SEGMENT} --backend tflite --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        code=3,
        given=yolo,
        right=cup_and_chair,
    ),
    Tried(
        f"{NETWORKS}/semantic.py",
        "gives instances, not the class of every pixel",
        f"{BY_ONNX} --weights yolo.onnx --semantic-weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx --semantic-weights voc.onnx",
        code=3,
        given=with_a_class_a_pixel,
        right=cup_and_chair,
    ),
    Tried(
        f"{NETWORKS}/onnx_network.py",
        "pip install onnxruntime",
        f"{BY_ONNX} --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        code=5,
        lacks=("onnxruntime",),
        given=yolo,
        right=cup_and_chair,
    ),
    Tried(
        f"{BACKENDS}/network/backend.py",
        "is not a checkpoint of the network of our own",
        f"{SEGMENT} --backend network --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        given=yolo,
        right=cup_and_chair,
    ),
    Tried(
        HUGGING, "needs a model", BY_MODEL, f"{BY_MODEL} {PANOPTIC}", code=5, right=labelled("huggingface mask2former")
    ),
    Tried(
        HUGGING,
        "are for open-vocabulary models",
        f"{BY_MODEL} {PANOPTIC} --words cup",
        f"{BY_MODEL} {PANOPTIC}",
        right=labelled("huggingface mask2former"),
    ),
    Tried(
        HUGGING,
        "needs a model that makes masks",
        f"{BY_MODEL} {DINO} --words cup",
        f"{BY_MODEL} {DINO} --words cup --mask-weights {{models}}/sam",
        code=5,
        right=labelled("grounding_dino"),
    ),
    *(
        Tried(
            HUGGING,
            "looks for words",
            f"{BY_MODEL} {DINO} --mask-weights {{models}}/sam",
            f"{BY_MODEL} {DINO} --mask-weights {{models}}/sam {advised}",
            given=words,
            right=labelled("grounding_dino"),
        )
        for advised in ('--words "cup, table"', "--labels words.txt")
    ),
    *(
        Tried(
            path,
            says,
            f"{DETECTING} {first}",
            f"{SEGMENT} --backend geometric" if then == "geometric" else f"{DETECTING} {then}",
            code=code,
            given=detectors,
            right=labelled("geometry alone" if then == "geometric" else "detector yolox"),
        )
        for path, says, first, then, code in (
            (DETECTOR, "needs the weights of a detector", "", "--weights yolox.onnx", 5),
            (DETECTOR, "needs the weights of a detector", "", "geometric", 5),
            (YOLOX, "with --weights", "--weights broken.onnx", "--weights yolox.onnx", 3),
        )
    ),
    Tried(
        YOLOX,
        "or --backend onnx for one that gives masks",
        f"{SEGMENT} --weights yolo.onnx",
        f"{BY_ONNX} --weights yolo.onnx",
        code=3,
        given=yolo,
        right=cup_and_chair,
    ),
    Tried(
        f"{NETWORKS}/tflite_network.py",
        "pip install ai-edge-litert",
        f"{DETECTING} --weights yolox.onnx --semantic-weights deeplab.tflite",
        f"{DETECTING} --weights yolox.onnx --semantic-weights deeplab.tflite",
        code=5,
        lacks=("ai_edge_litert.interpreter",),
        given=detectors,
        right=labelled("witnessed by deeplab"),
    ),
    Tried(
        SERVICE,
        "change --service-model",
        f"{BY_SERVICE} --service-model other",
        by_its_own_name,
        code=3,
        right=labelled("masks of fake 1"),
    ),
    Tried(
        SERVICE,
        "use another service, or --backend geometric",
        "segment --sequence {walks}/colourless --out out --backend {service}",
        "segment --sequence {walks}/colourless --out out --backend geometric",
        code=3,
        right=labelled("geometry alone"),
    ),
    Tried(
        SERVICE,
        "it goes on with this frame",
        asked("--retries=0", "--force", fails_at=0),
        asked("--retries=0"),
        code=6,
        right=labelled("masks of fake"),
    ),
    Tried("stages/segment/choice.py", "cannot be served", serve("ground-truth"), serve("geometric"), shows="serves"),
]
