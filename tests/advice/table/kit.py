"""What steps share: readers, language models, encoders, services."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from scenewright.cli.main import run
from scenewright.stages.kit.language.chat import Chat, ChatSettings
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.language.options import LanguageParameters

from tests.advice.inputs import room
from tests.advice.rows import NotTried, Tried
from tests.unit.disparity.pairs import pair, write_folder
from tests.unit.ingest.phone_writers import Take, write_r3d
from tests.unit.language.chats import GOOD, QUESTION, SCHEMA, opened, scripted
from tests.unit.language.stub_server import hangs_up, replies, serving, status

KIT = "stages/kit/"
OPENING = KIT + "language/opening.py"
TABLE = 'name = "mine"\nlabels = [{ id = 1, name = "zork", kind = "thing", class = "cup" }]\n'


def given_pairs(folder: Path) -> None:
    """A log of one stereo pair."""
    write_folder(folder / "log", [pair()[:2]])
    assert run(["ingest", "--log", str(folder / "log"), "--out", str(folder / "pairs"), "--quiet"]) == 0


def given_torn_frames(folder: Path) -> None:
    """Frames of the room, torn in the middle, and other files of its sequence."""
    shutil.copytree(Path(room()) / "sequence", folder / "sequence")
    content = (folder / "sequence" / "frames.mcap").read_bytes()
    (folder / "sequence" / "frames.mcap").write_bytes(content[: len(content) // 2])


def frames() -> object:
    """Read the frames as a notebook does."""
    from scenewright.stages.kit.formats.frames import FrameReader

    with FrameReader(Path("sequence/frames.mcap")) as reader:
        return f"{len(reader)} frames"


def masks() -> object:
    """Read masks that are none."""
    from scenewright.stages.kit.formats.masks import PanopticReader

    Path("panoptic.zip").write_bytes(b"no zip")
    with PanopticReader(Path("panoptic.zip")) as reader:
        return reader.read(0)


def foreign(*topics: str) -> Callable[[], object]:
    """Return what reads a file of colour pictures that others wrote, all at one time."""

    def read() -> object:
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
        from mcap_protobuf.writer import Writer
        from scenewright.stages.kit.formats.frames import FrameReader

        with Path("log.mcap").open("wb") as file, Writer(file) as writer:
            for topic in topics:
                writer.write_message(topic, CompressedImage(), 1_000_000_000)
        with FrameReader(Path("log.mcap")) as reader:
            return len(reader)

    return read


def wall() -> object:
    """Look for a floor where only a slanted wall was seen."""
    import numpy as np
    from scenewright.stages.kit.geometry.upright_world import make_upright

    points = np.stack(np.meshgrid(np.arange(0, 2, 0.02), [1.0], np.arange(0, 2, 0.02)), axis=-1).reshape(-1, 3)
    normal = np.array([-0.6, -0.6, 0.53]) / np.linalg.norm([0.6, 0.6, 0.53])
    points[:, 1] = (normal[1] - points[:, [0, 2]] @ normal[[0, 2]]) / normal[1]
    normals = np.tile(normal, (len(points), 1))
    pose = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
    return make_upright("floor", "z", None, pose[None], lambda: (points, normals), np.random.default_rng(0))


def trained(plan: str, out: str) -> Callable[[], object]:
    """Return what trains for no step at all."""

    def train() -> object:
        import torch
        from scenewright.stages.kit.training.run import TrainingRun

        class Run(TrainingRun):
            average_decay, gradient_norm = 0.9, 1.0

        Path(out).mkdir(exist_ok=True)
        run = Run(torch.nn.Conv2d(1, 1, 1), {"plan": plan}, Path(out), 1e-3, 0.0)
        run.save()
        return run.step

    return train


def matched(text: str = "") -> Callable[[], object]:
    """Return what looks up the names of a network; `text`: a table of them."""

    def match() -> object:
        from scenewright.stages.kit.labels import match_labels, read_label_file

        if text:
            Path("labels.toml").write_text(text)
        return match_labels({1: "zork"}, read_label_file(Path("labels.toml")) if text else None, where="a.onnx")

    return match


def transformers() -> object:
    """Load the library."""
    from scenewright.stages.kit.formats.transformers_folder import transformers_library

    return transformers_library().__name__


def colmap() -> object:
    """Load a library where it is needed."""
    from scenewright.stages.kit.needed import needed

    return needed("pycolmap", "bundle adjustment").__name__


def chat(**options: Any) -> Callable[[], object]:
    """Return what opens a chat with these options."""

    def ask() -> object:
        given = {name: value for name, value in options.items() if name not in ("transcript", "environment")}
        return open_chat(
            LanguageParameters(**given),
            scripted=scripted(),
            transcript=options.get("transcript"),
            environment=options.get("environment", {}),
        ).settings.model

    return ask


def given_transcript(folder: Path) -> None:
    """A transcript of one question to the model `stub`."""
    with serving(replies(GOOD)) as server:
        opened(server.base_url, record=folder / "t.jsonl").ask(QUESTION, SCHEMA)


def budget(**settings: int) -> Callable[[], object]:
    """Return what asks two questions within a budget."""

    def ask() -> object:
        asked = Chat(scripted(), ChatSettings(**settings))
        asked.ask(QUESTION, SCHEMA)
        return asked.ask(QUESTION, SCHEMA)

    return ask


def server(*behaviours: Any, **options: Any) -> Callable[[], object]:
    """Return what asks a server that behaves so."""

    def ask() -> object:
        with serving(*behaviours) as stub:
            return opened(stub.base_url, **options).ask(QUESTION, SCHEMA)

    return ask


def recorded(*texts: str) -> Callable[[], object]:
    """Return what asks a transcript for something else, or for what was asked."""

    def ask() -> object:
        from scenewright.stages.kit.language.messages import say

        question = tuple(say("user", text) for text in texts) or QUESTION
        parameters = LanguageParameters(language="recorded")
        return open_chat(parameters, scripted=scripted(), transcript=Path("t.jsonl")).ask(question, SCHEMA)

    return ask


def text_of(text: str) -> Callable[[], object]:
    """Return what reads a text with our own encoder."""

    def read() -> object:
        from scenewright.stages.kit.open_words.embedded import BUNDLED, EmbeddedEncoder
        from scenewright.stages.kit.open_words.encoder import checked_text

        return EmbeddedEncoder(BUNDLED).texts([checked_text(text)]).shape

    return read


def encoder(weights: Path | None) -> Callable[[], object]:
    """Return what opens the encoder of another library."""

    def read() -> object:
        from scenewright.stages.kit.open_words.opening import open_encoder
        from scenewright.stages.kit.open_words.options import EncoderParameters

        with mock.patch("scenewright.stages.kit.open_words.transformers_encoder.TransformersEncoder"):
            return open_encoder(EncoderParameters(encoder="huggingface"), weights)

    return read


def segmenter(is_there: bool) -> Callable[[], object]:
    """Return what asks a segmentation service what it is."""

    def ask() -> object:
        from scenewright.stages.kit.services.receiving import BoundedServer
        from scenewright.stages.kit.services.segmentation_client import connect, read_info

        from tests.unit.agent.test_seen_by_a_service import ByColor

        if not is_there:
            return read_info(connect("http://127.0.0.1:9", retries=0))
        with BoundedServer("127.0.0.1", 0, ByColor) as served:
            threading.Thread(target=served.serve_forever, daemon=True).start()
            try:
                return read_info(connect(f"http://127.0.0.1:{served.server_address[1]}"))
            finally:
                served.shutdown()

    return ask


def bad_urdf() -> object:
    """Load a body that the physics engine refuses."""
    from scenewright.stages.kit.simulation.world import PhysicsWorld

    with PhysicsWorld() as world:
        return world.load_urdf_text("<robot/>", fixed=True)


def fast_downward() -> object:
    """Look for the planner."""
    from scenewright.stages.kit.tasks.fast_downward import driver

    return driver()


def plan_of_another_task() -> object:
    """Read a plan that names no action."""
    from scenewright.stages.kit.tasks.fast_downward import read_plan

    return read_plan("(fly a b)", {})


PLAN = "plan --scene {golden}/interactive_scene --planner builtin --out p --dry-run"
ROWS = [
    Tried(
        KIT + "formats/frames.py",
        "scenewright disparity",
        "poses --sequence pairs --out p",
        "disparity --sequence pairs --out d && inspect d --frames 0",
        code=3,
        given=given_pairs,
        shows="kind       disparity",
    ),
    Tried(
        KIT + "formats/indexed_mcap.py",
        "make the artifact again; `scenewright verify`",
        frames,
        "ingest --log {room}/log/frames.mcap --out sequence --force && verify sequence",
        code=3,
        given=given_torn_frames,
        shows="sound    sequence",
    ),
    Tried(
        KIT + "formats/masks.py",
        "run `scenewright segment` again",
        masks,
        "segment --sequence {room}/sequence --backend ground-truth --out s --dry-run",
        code=3,
    ),
    NotTried(KIT + "formats/transformers_folder.py", "take a revision with", "it names a download"),
    Tried(
        KIT + "formats/transformers_folder.py",
        "pip install transformers",
        transformers,
        transformers,
        code=5,
        lacks=("transformers",),
    ),
    Tried(
        KIT + "geometry/upright_world.py",
        "--gravity auto",
        "ingest --log {room}/log/frames.mcap --gravity imu --out s",
        "ingest --log {room}/log/frames.mcap --gravity auto --out s",
        code=3,
        shows="gravity given",
    ),
    Tried(
        KIT + "geometry/upright_world.py",
        "--gravity camera-up",
        wall,
        "ingest --log {room}/log/frames.mcap --gravity camera-up --out s",
        code=3,
        shows="gravity mean_camera_up",
    ),
    Tried(KIT + "labels.py", "--labels FILE.toml", matched(), matched(TABLE), code=3),
    Tried(KIT + "needed.py", "pip install {}", colmap, colmap, code=5, lacks=("pycolmap",)),
    Tried(
        KIT + "language/chat.py",
        "--maximum-tokens when replies are cut short",
        server(replies("nonsense")),
        server(replies(GOOD), model="another"),
        code=3,
    ),
    Tried(KIT + "language/chat.py", "--call-budget", budget(call_budget=1), budget(call_budget=2)),
    Tried(KIT + "language/chat.py", "--token-budget", budget(token_budget=1), budget(token_budget=1000)),
    Tried(
        KIT + "language/openai_compatible.py",
        "does --base-url end with /v1",
        server(status(404)),
        server(replies(GOOD)),
        code=3,
    ),
    Tried(OPENING, "needs --model", chat(language="openai"), chat(language="openai", model="m")),
    Tried(
        OPENING,
        "export {}=",
        chat(language="openai", model="m", key_variable="KEY"),
        chat(language="openai", model="m", key_variable="KEY", environment={"KEY": "k"}),
        code=5,
    ),
    Tried(
        OPENING,
        "did you mean --language recorded?",
        chat(transcript=Path("t.jsonl")),
        chat(language="recorded", transcript=Path("t.jsonl")),
        given=given_transcript,
        shows="stub",
    ),
    Tried(
        OPENING,
        "--language recorded needs --transcript",
        chat(language="recorded"),
        chat(language="recorded", transcript=Path("t.jsonl")),
        given=given_transcript,
        shows="stub",
    ),
    Tried(
        OPENING,
        "--model is one of",
        chat(language="recorded", model="m", transcript=Path("t.jsonl")),
        chat(language="recorded", model="stub", transcript=Path("t.jsonl")),
        given=given_transcript,
        shows="stub",
    ),
    Tried(
        KIT + "language/recorded.py",
        "record it: --language openai",
        recorded("What else?"),
        recorded(),
        code=5,
        given=given_transcript,
        shows="answer=4",
    ),
    Tried(
        KIT + "open_words/embedded.py", "--encoder huggingface, or service", text_of("赤いカップ"), text_of("red cup")
    ),
    Tried(KIT + "open_words/encoder.py", '--text "red mug"', text_of("?!"), text_of("red mug")),
    Tried(
        KIT + "open_words/opening.py", "--encoder huggingface needs a model", encoder(None), encoder(Path("m")), code=5
    ),
    NotTried(KIT + "rendering/splatting/gpu.py", "leave out --device cuda", "it needs a machine with CUDA"),
    NotTried(KIT + "rendering/splatting/gpu.py", "pip install gsplat", "it needs a machine with CUDA"),
    Tried(
        KIT + "services/connection.py",
        "see --request-timeout and --retries",
        server(hangs_up, replies(GOOD), retries=0),
        server(hangs_up, replies(GOOD), retries=1),
        code=6,
    ),
    Tried(
        KIT + "services/segmentation_client.py",
        "start one (scenewright models serve",
        segmenter(False),
        segmenter(True),
        code=5,
        shows="by colour",
    ),
    Tried(
        KIT + "simulation/world.py", "run `scenewright verify`", bad_urdf, "verify {golden}/interactive_scene", code=3
    ),
    Tried(
        KIT + "needed.py",
        "pip install 'scenewright[{}]'",
        "ingest --log take.r3d --out out",
        "ingest --log take.r3d --out out",
        code=5,
        lacks=("lzfse",),
        given=lambda folder: write_r3d(folder / "take.r3d", Take(3)),
    ),
    Tried(KIT + "tasks/fast_downward.py", "pip install 'scenewright[planning-gpl]'", fast_downward, PLAN, code=5),
    Tried(KIT + "tasks/fast_downward.py", "take --planner builtin", plan_of_another_task, PLAN, code=3),
    Tried(
        KIT + "formats/frames.py",
        "topic {} is not {}",
        foreign("/camera/depth"),
        "ingest --log {room}/log/frames.mcap --out sequence",
        code=3,
    ),
    Tried(
        KIT + "formats/frames.py",
        "share the stamp",
        foreign("/left/color", "/right/color"),
        "ingest --log {room}/log/frames.mcap --out sequence",
        code=3,
    ),
    Tried(
        KIT + "training/run.py",
        "take another --out",
        trained("b", "run"),
        trained("b", "other"),
        code=3,
        given=lambda folder: trained("a", "run")(),
    ),
    Tried(
        KIT + "viewing/page/page_canvas.py",
        "choose another --save",
        "view {room}/sequence --save {room}/sequence/frames.mcap/page.html",
        "view {room}/sequence --save page.html",
        code=6,
        right=lambda folder: (folder / "page.html").stat(),
    ),
]
