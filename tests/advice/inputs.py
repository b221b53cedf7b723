"""Inputs that rows share, made once a process."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import tempfile
import threading
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from scenewright.cli.main import run
from scenewright.stages.cutting.recording.panels import HEIGHT, WIDTH
from scenewright.stages.cutting.recording.session import Session
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.tableware.world.overhead import overhead_camera

from tests.panoptic_maps import floor_mesh, write_map
from tests.strangers.logs import write_images
from tests.strangers.pictures import RED_AND_BLUE, SHOTS, TRUE
from tests.unit.cad.models import fridge as model_of_a_fridge
from tests.unit.cad.models import write_library
from tests.unit.cad.test_cad_stage import mesh_of
from tests.unit.disparity.pairs import pair as pictured
from tests.unit.disparity.pairs import write_folder
from tests.unit.disparity.test_rectification import turned
from tests.unit.edit.maps import dense, room_map
from tests.unit.housekeeping.tiny_run import make_tiny_run
from tests.unit.poses.textured_room import CAMERA, render, round_walk
from tests.unit.poses.textured_room import write_sequence as write_textured
from tests.unit.segment.test_service import FakeServer, good_reply
from tests.unit.segment.test_stage import write_sequence
from tests.unit.viewing.artifacts import seal

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@cache
def folder() -> Path:
    """Return a folder of this process, which goes with it."""
    made = Path(tempfile.mkdtemp(prefix="advice-"))
    atexit.register(_remove, made, os.getpid())
    return made


def _remove(made: Path, maker: int) -> None:
    if os.getpid() == maker:  # and not a process forked from it
        shutil.rmtree(made, ignore_errors=True)


@cache
def golden() -> str:
    """Return a folder with an artifact of every kind, named by it: whole documents, large payloads left out."""
    for version in sorted(GOLDEN.glob("v*")):
        shutil.copytree(version, folder() / "golden", dirs_exist_ok=True)
    return str(folder() / "golden")


@cache
def room() -> str:
    """Return a folder with the sequence of a small room that was ingested from `log/frames.mcap`: four frames."""
    made = folder() / "room"
    log = write_sequence(made / "log").sequence.path("frames.mcap")
    assert run(["ingest", "--log", str(log), "--out", str(made / "sequence")]) == 0
    return str(made)


@cache
def masks() -> str:
    """Return a folder with the true masks of that room (`segments`)."""
    made = folder() / "masks"
    assert run(["segment", f"--sequence={room()}/sequence", "--backend=ground-truth", f"--out={made}/segments"]) == 0
    return str(made)


@cache
def pan() -> str:
    """Return a folder with the sequence of a camera that turns (tests/strangers/pictures.py), ingested of logs whose
    pictures are numbered from 1: `whole`, and `gap` in which a picture of the log was lost."""
    made = folder() / "pan"
    for name, numbers in (("whole", (1, 2, 3, 4, 5, 6)), ("gap", (1, 2, 3, 4, 5, 7))):
        log = write_images(made / f"{name}_log", SHOTS, names=[f"{number:06d}" for number in numbers].__getitem__)
        assert run(["ingest", f"--log={log}", f"--out={made}/{name}", "--gravity=none"]) == 0
    return str(made)


@cache
def flags() -> str:
    """Return a sequence of one picture that is red on the left and blue on the right."""
    log = write_images(folder() / "flags_log", RED_AND_BLUE)
    assert run(["ingest", f"--log={log}", f"--out={folder()}/flags", "--gravity=none"]) == 0
    return str(folder() / "flags")


@cache
def models() -> str:
    """Return a folder with tiny models of transformers, `mask2former`, `grounding_dino` and `sam`; skip without."""
    pytest.importorskip("transformers")
    pytest.importorskip("torch").manual_seed(0)
    from tests.unit.segment import tiny_models

    for name in ("mask2former", "grounding_dino", "sam"):
        getattr(tiny_models, name)(folder() / "models" / name)
    return str(folder() / "models")


@cache
def server() -> FakeServer:
    """Return a segmentation service that finds a chair in the upper half of every picture."""
    reply = json.dumps(good_reply(TRUE[0].shape)).encode()
    made = FakeServer(lambda number: (200, {}, reply))
    threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    return made


def service() -> str:
    """Return the address of that service."""
    return "http://{}:{}".format(*server().server_address[:2])


@cache
def table() -> str:
    """Return a folder with the image of a table from above: in its middle a cylinder, 0.17 m wide and 0.055 m high.
    color.png, depth.npy [m] and camera.json; beside it millimetres.npy."""
    view, top = overhead_camera(width=640, rows=360), 0.83 - 0.055
    rows, columns = np.mgrid[:360, :640]
    there = np.hypot(columns - 320, rows - 180) * top / view.camera.fx < 0.085
    made = folder() / "table"
    made.mkdir()
    cv2.imwrite(str(made / "color.png"), np.where(there[..., None], 60, np.full((360, 640, 3), 225)).astype(np.uint8))
    depth = np.where(there, top, 0.83).astype(np.float32)
    np.save(made / "depth.npy", depth)
    np.save(folder() / "millimetres.npy", 1000 * depth)
    camera = {"camera": view.camera.model_dump(), "world_from_camera": view.world_from_camera.tolist()}
    (made / "camera.json").write_text(json.dumps(camera))
    return str(made)


@cache
def cut() -> str:
    """Return a folder with what a person cut twice: cuts.json, and the demonstrations made of it. Beside them
    `loaf.stl` [m] and `loaf_mm.stl`, 0.12 m long."""
    made, half = folder() / "cut", 0.5 * WIDTH
    made.mkdir()
    session = Session(made / "cuts.json", "carrot", 5)
    for _ in range(2):
        session.cut(np.array([[half, 5.0], [half, HEIGHT - 5.0]]))
        session.finish("slices")
    loaf = trimesh.creation.box((0.12, 0.04, 0.04))
    loaf.export(made / "loaf.stl")
    loaf.apply_scale(1000).export(made / "loaf_mm.stl")
    written = [f"--record={made}/cuts.json", f"--out={made}/demonstrations", "--image-width=300"]
    assert run(["cutting", "demonstrate", *written]) == 0
    return str(made)


@cache
def suture() -> str:
    """Return a folder with a rendered stereo pair of a needle (`scene`, whose `truth` holds masks), and the sequence
    that was ingested of it."""
    made = folder() / "suture"
    assert run(["suture", "scene", "--seed", "0", "--out", f"{made}/scene"]) == 0
    assert run(["ingest", "--log", f"{made}/scene/frames.mcap", "--out", f"{made}/sequence"]) == 0
    return str(made)


@cache
def walks() -> str:
    """Return a folder with logs of a room, `NAME_log/frames.mcap`, and the sequence NAME that was ingested of each:
    `unposed` frames, `colourless` ones, and of `two` cameras, of which `front` has one frame and `left` three."""
    made, path = folder() / "walks", round_walk(60)[:4]
    write_textured(made / "unposed_log", path)
    write_textured(made / "colourless_log", path, with_color=False)
    (made / "two_log").mkdir()
    cameras = {"front": CAMERA, "left": CAMERA}
    with FrameWriter(made / "two_log/frames.mcap", CAMERA, cameras=cameras) as writer:
        for index, pose in enumerate(path):
            writer.write(0.1 * index, *render(pose), pose, camera_name="left" if index else "front")
    for name in ("unposed", "colourless", "two"):
        several = ["--camera", "all"] if name == "two" else []
        assert run(["ingest", f"--log={made}/{name}_log/frames.mcap", f"--out={made}/{name}", *several]) == 0
    return str(made)


@cache
def pair() -> str:
    """Return a folder with a stereo log (`log`: left/, right/ and a calibration) and the sequence that was ingested of
    it; `turned` is the sequence of a log whose right eye is turned from what its calibration says."""
    made, (left, right, _, _) = folder() / "pair", pictured(noise=0.0)
    for name, eye in (("sequence", right), ("turned", turned(right, 0.01, 0.01))):
        log = made / ("log" if name == "sequence" else "turned_log")
        assert run(["ingest", "--log", str(write_folder(log, [(left, eye)])), "--out", str(made / name)]) == 0
    return str(made)


@cache
def fridge() -> str:
    """Return a folder with `library`, `map` and `graph` of a room in which a fridge stands."""
    made = folder() / "fridge"
    library = write_library(made / "library", {"fridge": model_of_a_fridge(0.6, 0.65, 1.6, (0.4, 0.8, 1.2))})
    meshes = floor_mesh((-2.0, -2.0), (2.0, 2.0)), mesh_of(library, "fridge", (0.5, 0.5, 0.0), 0.0)
    (made / "map").mkdir()
    write_map(made / "map", {k: dense(mesh, 0.05) for k, mesh in enumerate(meshes, 1)}, {1: "floor", 2: "fridge"})
    seal(made / "library", "cad_library")
    seal(made / "map", "panoptic_map")
    assert run(["graph", "--panoptic-map", f"{made}/map", "--out", f"{made}/graph"]) == 0
    return str(made)


@cache
def tiny() -> str:
    """Return a run folder with a small whole artifact of every kind, named by it."""
    return str(make_tiny_run(folder() / "tiny"))


@cache
def seen() -> str:
    """Return the panoptic map of a floor, a table, two cups and a cabinet."""
    room_map(folder() / "seen")
    return str(folder() / "seen")


INPUTS = {
    make.__name__: make
    for make in (golden, room, masks, pan, flags, models, service, table, cut, suture, walks, pair, fridge, tiny, seen)
}
"""What stands for `{name}` in a row's commands."""
