"""Commands that are no steps."""

from __future__ import annotations

import shutil
from pathlib import Path
from unittest import mock

from scenewright.cli.viewing import viewer_process
from scenewright.schemas.edits import Rename
from scenewright.stages.edit.edits_file import read_edits
from scenewright.stages.engine.batch.expansion import read_batch
from scenewright.stages.engine.batch.results import RESULTS_NAME, ResultsFile
from scenewright.stages.engine.batch.session import plan_batch

from tests.advice.inputs import room
from tests.advice.rows import NotTried, Tried
from tests.unit.batch.batches import result, write_batch
from tests.unit.housekeeping.artifacts import make_artifact
from tests.unit.ingest.tiny_room import frames, write_seven_scenes


def given_batch(folder: Path) -> None:
    """A batch whose only scene is no log."""
    write_batch(folder, {"a": "no log"})


def given_ended_array(folder: Path, executor: str = "slurm") -> None:
    """A batch whose only scene has ended badly."""
    spec = write_batch(folder, {"a": "no log"}, f'[executor]\nkind = "{executor}"\n')
    (job, _), *_ = plan_batch(read_batch(spec), folder / "out")
    (folder / "out").mkdir()
    ResultsFile(folder / "out" / RESULTS_NAME).append(result(job.name, "bad input", fingerprint=job.fingerprint))


def array_runs_all(folder: Path) -> None:
    assert "--retry all" in (folder / "out" / "slurm" / "array.sh").read_text()


def given_leftover(folder: Path) -> None:
    """What a killed run left beside its artifact."""
    shutil.copytree(Path(room()) / "sequence", folder / "run" / "sequence")
    left = folder / "run" / ".sequence.old-0123abcd"
    left.mkdir()
    (folder / "run" / ".sequence.lock").touch()
    (left / "frames.mcap").write_bytes(bytes(10_000))


def leftover_is_gone(folder: Path) -> None:
    assert not (folder / "run" / ".sequence.old-0123abcd").exists()
    assert (folder / "run" / "sequence" / "frames.mcap").is_file()


def given_log_without_calibration(folder: Path) -> None:
    """A pipeline, and a log that nothing says the focal lengths of."""
    write_seven_scenes(folder / "log", frames(3))
    (folder / "log" / "camera-intrinsics.txt").unlink()
    shutil.move(folder / "log", folder / "seq-01")


CHAIN = """
name = "chain"
summary = "one step"
[variables.log]
description = "a log"
[[step]]
name = "sequence"
stage = "ingest"
inputs = { log = "$log" }
"""


def given_tiny_pipeline(folder: Path) -> None:
    """A chain that goes on without frames."""
    (folder / "chain.toml").write_text(CHAIN + 'parameters = { start = 50 }\naccept = ["empty"]\n')


def given_two_artifacts(folder: Path) -> None:
    """Eight files of one are not in the other."""
    make_artifact(folder / "a")
    make_artifact(folder / "b", files={f"{k}.txt": "" for k in range(8)})


def given_checkpoint(folder: Path) -> None:
    import torch

    from tests.unit.disparity.test_raft import small_state

    torch.save(small_state(), folder / "raft.pth")
    (folder / "raft.safetensors").touch()


def cup_is_a_bottle(folder: Path) -> None:
    (edit,) = read_edits(folder / "edits.toml").edits
    assert isinstance(edit, Rename) and edit.class_name == "bottle"


def without_a_window() -> object:
    """Open a viewer where none can be started."""
    with mock.patch.object(viewer_process, "LONGEST_START", 0.0), mock.patch("subprocess.Popen"):
        return viewer_process.viewer_address(1)


RENAME = "edit rename edits.toml cup_3 --panoptic-map {seen} "
MOVE = "edit move edits.toml table_52 --shift 0 0 0.1 --cad-scene {golden}/cad_scene"
INGEST = "ingest --log {room}/log/frames.mcap --start 50 --out s"
FOCAL = "--set fx=100 --set fy=100 --set cx=47.5 --set cy=35.5"
ROWS = [
    Tried(
        "cli/application.py",
        "`scenewright run reconstruct` chains them",
        "--help",
        "run reconstruct --set log={room}/log/frames.mcap --only sequence --out run",
        code=0,
    ),
    Tried(
        "cli/batch_command.py",
        "--retry {}: not one of {}",
        "batch batch.toml --retry some --out b --dry-run",
        "batch batch.toml --retry none --out b --dry-run",
        given=given_batch,
        shows="would run",
    ),
    Tried(
        "cli/batch_command.py",
        "--retry all runs them again",
        "batch batch.toml --retry none --out out",
        "batch batch.toml --retry all --out out",
        code=3,
        given=given_ended_array,
        right=array_runs_all,
    ),
    Tried(
        "cli/collection_command.py",
        "--delete frees",
        "gc run",
        "gc run --delete",
        code=0,
        given=given_leftover,
        right=leftover_is_gone,
        shows="freed",
    ),
    Tried(
        "cli/comparison_command.py",
        "--all lists them",
        "diff a b",
        "diff a b --all",
        code=0,
        given=given_two_artifacts,
        shows="7.txt",
    ),
    Tried(
        "cli/edit_command.py",
        "scenewright edit {} {} ... --edits {} --out ...",
        RENAME + "--class bottle",
        "edit map --panoptic-map {seen} --edits edits.toml --out map && inspect map",
        code=0,
        right=cup_is_a_bottle,
        shows="outcome    ok",
    ),
    Tried("cli/edit_command.py", "give --to or --shift, not both", MOVE + " --to 1 1 1", MOVE),
    Tried(
        "cli/edit_command.py",
        "see --help",
        RENAME + "--class nothing",
        "edit rename --help",
        shows="A class of data/vocabulary.toml",
    ),
    Tried(
        "cli/housekeeping.py",
        "not variable=value",
        "run demo --set seed --out r --dry-run",
        "run demo --set seed=3 --out r --dry-run",
    ),
    Tried(
        "cli/housekeeping.py",
        "--accept {} exits with 0",
        "run chain.toml --set log={room}/log/frames.mcap --out r",
        "run chain.toml --set log={room}/log/frames.mcap --out r --accept empty",
        code=4,
        given=given_tiny_pipeline,
    ),
    Tried(
        "cli/housekeeping.py",
        "what it asks for is given as --set name=value",
        "run reconstruct --set log=seq-01 --only sequence --out r",
        f"run reconstruct --set log=seq-01 --only sequence --out r {FOCAL}",
        code=3,
        given=given_log_without_calibration,
    ),
    Tried(
        "cli/inspect_command.py",
        "a log is judged by its frames",
        "inspect {room}/log/frames.mcap --frames 1",
        "inspect {room}/log/frames.mcap --frames 2",
        shows="verdict      ready",
    ),
    Tried(
        "cli/inspect_command.py",
        "--set is for logs",
        "inspect {room}/sequence --set depth_scale=1000",
        "inspect {room}/sequence --frames 0",
        shows="parameter  depth_scale = None",
    ),
    Tried(
        "cli/inspect_command.py",
        "--html is for logs and sequences",
        "inspect {golden}/segments --html page.html",
        "report --segments {golden}/segments --out page",
        right=lambda folder: (folder / "page" / "report.html").stat(),
    ),
    Tried("cli/main.py", "{}{} (see --help)", "ingest", "ingest --help", shows="log: a file (MCAP, bag) or a folder"),
    Tried("cli/step_command.py", "--accept {} goes on", INGEST, INGEST + " --accept empty", code=4),
    Tried(
        "cli/view_command.py",
        "--save and --rerun are two ways",
        "view {room}/sequence --save page.html --rerun",
        "view {room}/sequence --save page.html",
    ),
    Tried(
        "cli/view_command.py",
        "are for a page that is served: without --save and --rerun",
        "view {room}/sequence --save page.html --port 9000",
        "view {room}/sequence --save page.html",
    ),
    Tried(
        "cli/explaining/explaining.py",
        "lists its names",
        "explain {fridge}/graph %",
        "explain {fridge}/graph",
        shows="fridge_",
    ),
    Tried(
        "cli/viewing/rerun_canvas.py",
        "pip install",
        "view {room}/sequence --save log.rrd",
        "view {room}/sequence --save log.rrd",
        code=5,
        lacks=("rerun",),
        right=lambda folder: (folder / "log.rrd").stat(),
    ),
    Tried(
        "cli/viewing/viewer_process.py",
        "--save FILE.rrd",
        without_a_window,
        "view {room}/sequence --save log.rrd",
        code=6,
        right=lambda folder: (folder / "log.rrd").stat(),
    ),
    Tried(
        "cli/weights_command.py",
        "choose another --out",
        "convert-weights raft.pth --out raft.safetensors",
        "convert-weights raft.pth --out other.safetensors",
        given=given_checkpoint,
    ),
    NotTried("cli/main.py", "internal error", "what brings it up is a fault of ours, which nobody knows yet"),
]
