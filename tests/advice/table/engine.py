"""What every step and every run says: folders, inputs, memory, models."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable
from errno import ENOSPC
from pathlib import Path
from unittest import mock

from scenewright.cli.main import run
from scenewright.stages.engine import diagnosis
from scenewright.stages.engine.batch.results import RESULTS_NAME
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.loading import load_run
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.runner import run_stage

from tests.advice.inputs import GOLDEN, golden, room
from tests.advice.rows import NotTried, Tried, nothing
from tests.advice.table.cli import CHAIN, given_ended_array
from tests.unit.batch.batches import write_batch
from tests.unit.housekeeping.artifacts import make_artifact

ENGINE = "stages/engine/"
INGEST = "ingest --log {room}/log/frames.mcap "
ARRAY = "batch batch.toml --out out "
held: list[int] = []
"""Locks of runs that never end."""


def hold(lock: Path) -> None:
    """Lock a file as another run does."""
    lock.parent.mkdir(exist_ok=True)
    held.append(os.open(lock, os.O_RDWR | os.O_CREAT))
    fcntl.flock(held[-1], fcntl.LOCK_EX)


def given_file_in_the_way(name: str) -> Callable[[Path], None]:
    """Return what puts a file where a folder has to stand, beside a batch."""

    def given(folder: Path) -> None:
        given_ended_array(folder)
        (folder / name).touch()

    return given


def given_held_batch(folder: Path) -> None:
    """A batch that another one runs."""
    given_ended_array(folder)
    hold(folder / "out" / ".batch.lock")


def given_sequence(damage: Callable[[Path], object]) -> Callable[[Path], None]:
    """Return what copies the sequence of the room, and damages it."""

    def given(folder: Path) -> None:
        shutil.copytree(Path(room()) / "sequence", folder / "sequence")
        damage(folder / "sequence")

    return given


def changed(path: Path, old: bytes, new: bytes) -> None:
    """Write a file with other bytes, as many as before."""
    content = path.read_bytes()
    assert old in content and len(old) == len(new)
    path.write_bytes(content.replace(old, new, 1))


def edited(manifest: Path) -> None:
    """Write another digest into a manifest."""
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"content_digest": "0" * 64}))


def remade(says: str, first: str, damage: Callable[[Path], object], path: str = ENGINE + "reading.py") -> Tried:
    """Return the row of a damaged sequence, which is made again."""
    then = f"{INGEST} --out sequence --force && {first}"
    return Tried(path, says, first, then, code=3, given=given_sequence(damage))


def given_loop(folder: Path) -> None:
    (folder / "loop").symlink_to("loop")


def given_stranger(folder: Path) -> None:
    (folder / "mine").mkdir()
    (folder / "mine" / "notes.txt").touch()


def given_manifest_of_another(folder: Path) -> None:
    (folder / "app").mkdir()
    (folder / "app" / "manifest.json").write_text("{}")


def other_out(
    says: str, out: str, given: Callable[[Path], object] = nothing, code: int = 2, path: str = "store.py"
) -> Tried:
    """Return the row of an output that cannot be."""
    return Tried(
        ENGINE + path,
        says,
        f"{INGEST} --out {out}",
        f"{INGEST} --out other --dry-run",
        code=code,
        given=given,
        shows="nothing is made yet",
    )


def with_a_full_disk() -> int:
    """Make a sequence where the system says that the disk is full."""
    full = OSError(ENOSPC, "No space left on device")
    with mock.patch("scenewright.stages.engine.store.check_target", side_effect=full):
        return run(["ingest", "--log", f"{room()}/log/frames.mcap", "--out", "s"])


def to_nowhere() -> object:
    """Write where no folder can be."""
    stage = all_stages()["report"]
    return run_stage(stage, {}, Path("a\0b"), stage.parameters())


def with_no_room() -> int:
    """Run a pipeline where the disk is nearly full."""
    with mock.patch("scenewright.stages.engine.estimation.free_bytes", return_value=0):
        return run(["run", "reconstruct", "--set", f"log={room()}/log/frames.mcap", "--out", "r", "--only", "sequence"])


def given_ray(folder: Path) -> None:
    """A batch for Ray, which is not here, and one without, whose only scene has ended badly."""
    write_batch(folder, {"a": "no log"}, '[executor]\nkind = "ray"\n').rename(folder / "ray.toml")
    given_ended_array(folder, "local")


def given_folder_for_results(folder: Path) -> None:
    """A batch, and a folder where its results would be written."""
    given_ended_array(folder)
    (folder / "no" / RESULTS_NAME).mkdir(parents=True)


def doctor(*names: str) -> Callable[[], object]:
    """Return what asks the doctor for a few distributions alone."""

    def ask() -> object:
        core, extras = (
            {name: table[name] for name in names if name in table} for table in (diagnosis.CORE, diagnosis.EXTRAS)
        )
        with (
            mock.patch.object(diagnosis, "CORE", core),
            mock.patch.object(diagnosis, "EXTRAS", extras),
            mock.patch.object(diagnosis, "all_stages", dict),
            mock.patch.object(diagnosis, "checkout", lambda: None),
        ):
            return "\n".join(f"{check.name} {check.found} {check.remedy}" for check in diagnosis.diagnose())

    return ask


def installed(says: str, distribution: str, module: str) -> Tried:
    """Return the row of a distribution that the doctor misses."""
    ask = doctor(distribution)
    return Tried(ENGINE + "diagnosis.py", says, ask, ask, code=0, lacks=(module,), shows=distribution)


def tables() -> object:
    """Return the tables of a sequence, as a notebook does."""
    from scenewright.stages.engine.tables import as_tables

    return as_tables(open_artifact(Path(golden()) / "sequence"))


ROWS = [
    Tried(
        ENGINE + "batch/folder_lock.py",
        "{}: {} (choose another --out)",
        "batch batch.toml --out file/out",
        "batch batch.toml --retry all --out out",
        code=6,
        given=given_file_in_the_way("file"),
    ),
    Tried(
        ENGINE + "batch/folder_lock.py",
        "another batch is running in it",
        ARRAY,
        "batch batch.toml --out other",
        code=6,
        given=given_held_batch,
    ),
    Tried(
        ENGINE + "batch/slurm_executor.py",
        "not INDEX/COUNT",
        ARRAY + "--task 1",
        ARRAY + "--retry all && " + ARRAY + "--task 0/20 --retry none",
        given=given_ended_array,
        then_code=3,
    ),
    Tried(
        ENGINE + "batch/slurm_executor.py",
        "choose another --out",
        ARRAY + "--retry all",
        "batch batch.toml --out other",
        code=6,
        given=given_file_in_the_way("out/slurm"),
    ),
    Tried(
        ENGINE + "batch/slurm_executor.py",
        "run the batch without --task first",
        ARRAY + "--task 0/1",
        ARRAY + "--retry all && " + ARRAY + "--task 0/1 --retry none",
        given=given_ended_array,
        then_code=3,
    ),
    Tried(
        ENGINE + "batch/ray_executor.py",
        "the ray executor needs Ray",
        "batch ray.toml --out other",
        ARRAY + "--retry none",
        code=5,
        then_code=3,
        given=given_ray,
        lacks=("ray",),
    ),
    Tried(
        ENGINE + "batch/results.py",
        "choose another --out",
        "batch batch.toml --out no --collect",
        ARRAY + "--collect",
        code=6,
        then_code=3,
        given=given_folder_for_results,
    ),
    Tried(
        ENGINE + "estimation.py",
        "free space (scenewright gc)",
        with_no_room,
        "gc . && run reconstruct --set log={room}/log/frames.mcap --out r --dry-run --only sequence",
        code=6,
    ),
    NotTried(
        ENGINE + "batch/slurm_executor.py",
        "export {}={}",
        "a line of a script, which tests/unit/batch/test_slurm.py reads as a shell does",
    ),
    Tried(
        "cli/main.py",
        "run: scenewright doctor",
        "makefile demo",
        doctor("trimesh"),
        code=5,
        shows="trimesh",
        lacks=("scenewright.stages.engine.make_rules",),
    ),
    installed("poses --bundle-adjustment", "pycolmap", "pycolmap"),
    installed("viewing artifacts: pip install rerun-sdk", "rerun-sdk", "rerun"),
    installed("batches on a cluster: pip install ray", "ray", "ray"),
    installed("opening scene.mjcf.xml: pip install mujoco", "mujoco", "mujoco"),
    installed("pip install coacd", "coacd", "coacd"),
    installed("make fuzz: pip install atheris", "atheris", "atheris"),
    installed("pip install {}", "trimesh", "trimesh"),
    NotTried(ENGINE + "hub_cache.py", "--revision {}", "it names a download"),
    NotTried(
        ENGINE + "model_cache.py",
        "get {} from {}",
        "it names a download; `models --add` is tried in tests/unit/housekeeping/test_model_cache.py",
    ),
    Tried(
        ENGINE + "known_models.py", "no such file", "models --check nowhere.onnx", "models", code=3, shows="yolox_nano"
    ),
    Tried(
        ENGINE + "known_models.py",
        "is not a network listed here",
        "models --check a.onnx",
        "models",
        code=3,
        shows="yolox_nano",
        given=lambda folder: (folder / "a.onnx").touch(),
    ),
    Tried(
        ENGINE + "model_cache.py",
        "no such weight file",
        "segment --sequence {room}/sequence --backend detector --weights nowhere.onnx --out s",
        "models",
        code=5,
        shows="yolox_nano",
    ),
    Tried(
        ENGINE + "memory_limit.py",
        "of memory in use",
        "report --sequence {room}/sequence --out page --max-memory 1MiB",
        "report --sequence {room}/sequence --out page --max-memory 4GiB",
        code=6,
    ),
    Tried(
        ENGINE + "memory_limit.py",
        "for example --max-memory 4GiB",
        INGEST + "--max-memory lots --out s --dry-run",
        INGEST + "--max-memory 4GiB --out s --dry-run",
    ),
    Tried(
        ENGINE + "migration.py",
        "--out is the artifact itself",
        "migrate sequence --out sequence",
        "migrate sequence --out new && inspect new --frames 0",
        given=lambda folder: shutil.copytree(GOLDEN / "v1" / "sequence", folder / "sequence"),
        shows="sequence version 3",
    ),
    Tried(
        ENGINE + "reading.py",
        "run: scenewright migrate",
        "inspect sequence --frames 0",
        "migrate sequence --out sequence-v2 && inspect sequence-v2 --frames 0",
        code=3,
        given=lambda folder: shutil.copytree(GOLDEN / "v1" / "sequence", folder / "sequence"),
        shows="sequence version 3",
    ),
    Tried(
        ENGINE + "pipelines.py",
        "see its --help",
        "run chain.toml --out r",
        "ingest --help",
        given=lambda folder: (folder / "chain.toml").write_text(CHAIN + "parameters = { begin = 50 }"),
        shows="--start",
    ),
    Tried(
        ENGINE + "pipelines.py",
        "--set {}=...",
        "run reconstruct --out r --only sequence --dry-run",
        "run reconstruct --out r --only sequence --dry-run --set log={room}/log/frames.mcap",
    ),
    remade("{}: missing", "inspect sequence", lambda sequence: (sequence / "frames.mcap").unlink()),
    remade(
        "bytes, the manifest says", "inspect sequence", lambda sequence: (sequence / "trajectory.tum").write_text("")
    ),
    remade("was edited", "report --sequence sequence --out page", lambda sequence: edited(sequence / "manifest.json")),
    remade(
        "its bytes changed since",
        "report --sequence sequence --out page",
        lambda sequence: changed(sequence / "trajectory.tum", b"0.1", b"0.2"),
    ),
    remade(
        "artifacts are damaged",
        "verify sequence",
        lambda sequence: changed(sequence / "trajectory.tum", b"0.1", b"0.2"),
        "cli/housekeeping.py",
    ),
    Tried(ENGINE + "run_folders.py", "no such run folder", lambda: load_run("a"), lambda: load_run(room()), code=3),
    Tried(ENGINE + "run_folders.py", "holds no artifacts", lambda: load_run("."), lambda: load_run(room()), code=3),
    Tried(
        ENGINE + "runner.py",
        "--shared is for steps without inputs",
        "report --sequence {room}/sequence --shared all --out page --dry-run",
        "report --sequence {room}/sequence --out page --dry-run",
    ),
    Tried(
        ENGINE + "runner.py",
        "use --device cpu",
        INGEST + "--out s --device cuda",
        INGEST + "--out s --device cpu",
        code=5,
    ),
    Tried(
        ENGINE + "runner.py",
        "--{} is missing",
        "fuse --sequence {room}/sequence --out m",
        "fuse --help",
        shows="--segments",
    ),
    Tried(ENGINE + "runner.py", "free space or choose another --out", with_a_full_disk, INGEST + "--out s", code=6),
    other_out("links that lead in a circle", "loop", given_loop, path="runner.py"),
    Tried(ENGINE + "runner.py", "--out {}: {}", to_nowhere, INGEST + "--out s --dry-run"),
    other_out("{}: {} (choose another --out)", "a" * 300, code=6, path="runner.py"),
    other_out("a file stands there", "file", lambda folder: (folder / "file").touch()),
    other_out("{}: {} (choose another --out)", "file/s", lambda folder: (folder / "file").touch(), code=6),
    other_out("is not one that a step wrote", "app", given_manifest_of_another),
    other_out("holds a {} artifact, not {}", "a", lambda folder: make_artifact(folder / "a")),
    other_out("holds files that no step wrote", "mine", given_stranger),
    other_out("another run is writing it", "s", lambda folder: hold(folder / ".s.lock"), code=6),
    other_out("{}: {} (choose another --out)", "a" * 240, code=6),
    Tried(
        ENGINE + "tables.py",
        "pip install 'scenewright[notebooks]'",
        tables,
        tables,
        code=5,
        lacks=("pandas",),
        shows="label_table",
    ),
]
