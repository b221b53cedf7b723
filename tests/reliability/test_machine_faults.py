"""Faults of the machine and its disk, one test each: exit code, one line, the previous artifact as it was."""

from __future__ import annotations

import fcntl
import json
import multiprocessing
import os
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput, MachineFailure, ScenewrightError, UsageError
from scenewright.schemas.manifest import LARGEST_MANIFEST, MANIFEST_NAME, Manifest
from scenewright.stages.engine import interruption, runner, store
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.runner import RunResult, run_stage
from scenewright.stages.engine.verification import verify

from tests.contract.probe_step import PROBE, ProbeParameters
from tests.reliability.running import REPOSITORY, file_size_limit, memory_limit, only_error, run_probe, small_disk


@pytest.fixture(autouse=True)
def probe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(all_stages(), "probe", PROBE)


def make(out: Path, inputs: dict[str, Path] | None = None, *, force: bool = False, **values) -> RunResult:
    return run_stage(PROBE, inputs or {}, out, ProbeParameters(**values), force=force)


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def beside(out: Path) -> set[str]:
    found = {path.name for path in out.parent.iterdir() if path.name.startswith(f".{out.name}.")}
    return found - {f".{out.name}.lock"}


def assert_sound(out: Path) -> None:
    assert [problem for finding in verify(out) for problem in finding.problems] == []


# --- the disk ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [16_000, 40_000, 60_000])
def test_full_disk(tmp_path: Path, size: int) -> None:
    """A disk that holds the old artifact (32 kB) and a part of the new one, or all but its manifest."""
    with small_disk(tmp_path / "disk", "size=128k") as disk:
        out = disk / "a"
        make(out)
        before = content(out)
        (disk / "filling").write_bytes(bytes(60_000 - size) if size < 60_000 else b"")
        done = run_probe("--out", out, "--text", "0123456789" if size < 60_000 else "012345678")
        assert done.returncode == 6 and "No space left" in only_error(done) and "free space" in only_error(done)
        assert content(out) == before and beside(out) == set()
        assert_sound(out)
        (disk / "filling").unlink()
        assert run_probe("--out", out, "--text", "b").returncode == 0


def test_no_room_for_another_file(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", "size=1m,nr_inodes=12") as disk:
        done = run_probe("--out", disk / "a", "--files", "20")
        assert done.returncode == 6 and "No space left" in only_error(done)
        assert not (disk / "a").exists() and beside(disk / "a") == set()


def test_file_size_limit(tmp_path: Path) -> None:
    make(tmp_path / "a")
    before = content(tmp_path / "a")
    done = run_probe("--out", tmp_path / "a", "--text", "longer than before", limits=file_size_limit(5000))
    assert done.returncode == 6 and "File too large" in only_error(done)
    assert content(tmp_path / "a") == before and beside(tmp_path / "a") == set()


def test_read_only_disk(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", "size=1m") as disk:
        make(disk / "a")
        before = content(disk / "a")
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        for out, words in ((disk / "a", ("--text", "b")), (disk / "new", ())):
            done = run_probe("--out", out, *words)
            assert done.returncode == 6 and "Read-only file system" in only_error(done)
        assert content(disk / "a") == before
        assert open_artifact(disk / "a").kind == "trajectory"  # reading needs no writing
        assert verify(disk / "a")[0].problems == ()


def _make_as_nobody(answer: multiprocessing.SimpleQueue, out: Path, inputs: dict[str, Path]) -> None:
    os.setgid(65534)
    os.setuid(65534)
    try:
        make(out, inputs, text="b")
    except ScenewrightError as error:
        answer.put((error.exit_code, str(error)))
    except BaseException as error:
        answer.put((1, repr(error)))


def make_as_nobody(out: Path, inputs: dict[str, Path] | None = None) -> tuple[int, str]:
    """Return the exit code and the error of a run by a user without rights."""
    fork = multiprocessing.get_context("fork")
    answer = fork.SimpleQueue()
    process = fork.Process(target=_make_as_nobody, args=(answer, out, inputs or {}))
    process.start()
    process.join()
    return answer.get()


@pytest.mark.skipif(os.getuid() != 0, reason="needs root, to become somebody else")
@pytest.mark.parametrize("case", ["folder", "lock", "artifact", "input", "log"])
def test_no_permission(tmp_path: Path, case: str) -> None:
    folder, open_folder = tmp_path / "shared", tmp_path / "open"
    for path, mode in ((folder, 0o755), (open_folder, 0o777), *((parent, 0o755) for parent in tmp_path.parents[:-2])):
        path.mkdir(exist_ok=True)
        path.chmod(mode)
    tmp_path.chmod(0o755)
    out = folder / "a"
    make(out)
    before = content(out)
    if case in ("input", "log"):
        (out / "file-0.txt").chmod(0o600)
        inputs = {"upstream": out} if case == "input" else {"log": out / "file-0.txt"}
        code, error = make_as_nobody(open_folder / "b", inputs)
        assert code == 3 and "Permission denied" in error and "file-0.txt" in error
        assert not (open_folder / "b").exists()
        return
    if case != "folder":
        folder.chmod(0o777)
    if case == "artifact":
        (folder / ".a.lock").chmod(0o666)
        out.chmod(0o000)
    code, error = make_as_nobody(out)
    out.chmod(0o755)
    assert code == 6 and "Permission denied" in error
    assert content(out) == before and beside(out) == set()


# --- paths -------------------------------------------------------------------------------------------------------


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UsageError, match="a file stands there"):
        make(tmp_path / "file")
    with pytest.raises(MachineFailure, match="a file stands in its path"):
        make(tmp_path / "file" / "a")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("length", [240, 245, 252, 300])
def test_names_that_are_too_long(tmp_path: Path, length: int) -> None:
    with pytest.raises(MachineFailure, match="name too long"):
        make(tmp_path / ("a" * length))
    assert [path.name for path in tmp_path.iterdir() if not path.name.endswith(".lock")] == []


def test_a_path_that_is_too_long(tmp_path: Path) -> None:
    with pytest.raises(MachineFailure, match="name too long"):
        make(tmp_path.joinpath(*["d" * 200] * 25))
    with pytest.raises(BadInput, match="name too long"):
        make(tmp_path / "b", {"log": tmp_path.joinpath(*["d" * 200] * 25)})


@pytest.mark.parametrize(
    "name", ["with blank", "Küche 台所", "two\nlines", "quote'\"", "run[1]", "*", "-dash", "%s", "{x}"]
)
def test_odd_names(tmp_path: Path, name: str) -> None:
    out = tmp_path / name / "a"
    if name in ("two\nlines", "-dash"):
        done = run_probe("--out", out)
        assert done.returncode == 0 and done.stdout == f"{out}\n"
    assert make(out).path == out
    killed = store._beside(tmp_path / name, "partial-1-00000000")
    killed.mkdir()
    shutil.copytree(out, tmp_path / "of another run")
    make(tmp_path / name / name, {"upstream": out})
    assert_sound(tmp_path / name / name)
    with store.locked(tmp_path / name):
        assert not killed.exists()


def test_sweeping_leaves_what_others_own(tmp_path: Path) -> None:
    """A target called like a pattern, or like the beginning of another name, sweeps its own leftovers only."""
    kept = [".ab.partial-1-00000000", ".a.partial-1-0000000g", ".a.b.partial-1-00000000", ".a.old", ".a.partial-x.lock"]
    for name in kept:
        (tmp_path / name).mkdir()
    (tmp_path / ".a.partial-77-0123abcd").mkdir()
    (tmp_path / ".a.old-0123abcd").mkdir()
    for target in ("a*", "a", "?"):
        with store.locked(tmp_path / target):
            pass
    assert {path.name for path in tmp_path.iterdir() if not path.name.endswith("lock")} == set(kept[:4])


def test_names_that_are_no_text(tmp_path: Path) -> None:
    odd = os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9")
    with pytest.raises(UsageError, match="no UTF-8 name"):
        make(Path(odd))
    folder = tmp_path / "log"
    folder.mkdir()
    (folder / os.fsdecode(b"caf\xe9.png")).write_bytes(b"x")
    assert make(tmp_path / "a", {"log": folder}).status == "made"  # names inside a log folder may be anything
    os.rename(folder, odd)
    with pytest.raises(UsageError, match="--log"):
        make(tmp_path / "a", {"log": Path(odd)})


def test_an_output_folder_that_is_a_link(tmp_path: Path) -> None:
    """The folder behind the link is replaced; the link stays, and so do the ways to the inputs."""
    (tmp_path / "disk" / "deep").mkdir(parents=True)
    make(tmp_path / "disk" / "deep" / "a")
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "a").symlink_to(tmp_path / "disk" / "deep" / "a")
    make(tmp_path / "up")
    for text in ("b", "c"):
        assert make(tmp_path / "runs" / "a", {"upstream": tmp_path / "up"}, text=text).status == "made"
    assert (tmp_path / "runs" / "a").is_symlink()
    assert beside(tmp_path / "disk" / "deep" / "a") == set() and beside(tmp_path / "runs" / "a") == set()
    for path in (tmp_path / "runs" / "a", tmp_path / "disk" / "deep" / "a"):
        assert [finding.notes for finding in verify(path)] == [(), ()]
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises((UsageError, MachineFailure)):
        make(tmp_path / "circle")
    (tmp_path / "dangling").symlink_to(tmp_path / "not yet")
    make(tmp_path / "dangling")
    assert_sound(tmp_path / "not yet")


def test_umask_is_respected(tmp_path: Path) -> None:
    done = run_probe("--out", tmp_path / "a", limits=lambda: os.umask(0o077) and None)
    assert done.returncode == 0
    assert {stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "a").iterdir()} == {0o600}
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o700


# --- locks, clocks, moves -----------------------------------------------------------------------------------------


def test_the_lock_of_a_dead_process_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / ".a.lock").write_text("99999")
    (tmp_path / ".a.partial-99999-0123abcd").mkdir()
    assert make(tmp_path / "a").status == "made" and beside(tmp_path / "a") == set()


def test_leftovers_go_even_when_there_is_nothing_to_do(tmp_path: Path) -> None:
    make(tmp_path / "a")
    (tmp_path / ".a.partial-99999-0123abcd").mkdir()
    assert make(tmp_path / "a").status == "up to date" and beside(tmp_path / "a") == set()


def test_a_held_lock_fails_at_once(tmp_path: Path) -> None:
    make(tmp_path / "a")
    with (tmp_path / ".a.lock").open("r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        started = time.monotonic()
        done = run_probe("--out", tmp_path / "a", "--text", "b")
        assert done.returncode == 6 and "another run is writing it" in only_error(done)
        assert time.monotonic() - started < 20
        (tmp_path / ".a.partial-1-0123abcd").mkdir()  # of the run that holds the lock
        run_probe("--out", tmp_path / "a", "--text", "b")
        assert (tmp_path / ".a.partial-1-0123abcd").exists()


@pytest.mark.parametrize(
    "text", ["", "[]", '{"partial": 3, "old": []}', '{"partial": "../x", "old": "b"}', "[" * 100_000]
)
def test_a_journal_that_is_none(tmp_path: Path, text: str) -> None:
    make(tmp_path / "a")
    (tmp_path / ".a.journal").write_text(text)
    assert open_artifact(tmp_path / "a").outcome == "ok"
    assert beside(tmp_path / "a") == set()


def test_a_clock_that_was_set_back(tmp_path: Path) -> None:
    """Keys hold content, so that times decide nothing: an artifact from the future is up to date, or made again."""
    make(tmp_path / "up")
    make(tmp_path / "down", {"upstream": tmp_path / "up"})
    future = time.time() + 10 * 365 * 86400
    for path in (*(tmp_path / "up").iterdir(), *(tmp_path / "down").iterdir()):
        os.utime(path, (future, future))
    assert make(tmp_path / "down", {"upstream": tmp_path / "up"}).status == "up to date"
    make(tmp_path / "up", text="b")
    assert make(tmp_path / "down", {"upstream": tmp_path / "up"}).status == "made"


def test_a_moved_run_is_up_to_date_where_it_is_now(tmp_path: Path) -> None:
    def chain(folder: Path) -> list[str]:
        first = make(folder / "up")
        return [first.status, make(folder / "down", {"upstream": folder / "up"}).status]

    assert chain(tmp_path / "run") == ["made", "made"]
    shutil.move(tmp_path / "run", tmp_path / "elsewhere")
    assert chain(tmp_path / "elsewhere") == ["up to date", "up to date"]
    shutil.copytree(tmp_path / "elsewhere", tmp_path / "a" / "copy")
    assert chain(tmp_path / "a" / "copy") == ["up to date", "up to date"]
    for finding in verify(tmp_path / "a" / "copy" / "down"):
        assert finding.problems == () and finding.notes == ()


def test_a_single_artifact_that_was_moved(tmp_path: Path) -> None:
    make(tmp_path / "run" / "up")
    make(tmp_path / "run" / "down", {"upstream": tmp_path / "run" / "up"})
    shutil.move(tmp_path / "run" / "down", tmp_path / "down")
    (finding,) = verify(tmp_path / "down")
    assert finding.problems == () and "input upstream is no longer at" in finding.notes[0]


# --- edited artifacts ---------------------------------------------------------------------------------------------


def swap(out: Path) -> None:
    text = (out / "file-0.txt").read_text()
    (out / "file-0.txt").write_text("z" + text[1:])


def edit_manifest(out: Path, **changes: object) -> None:
    manifest = json.loads((out / MANIFEST_NAME).read_text())
    (out / MANIFEST_NAME).write_text(json.dumps({**manifest, **changes}))


def forge(out: Path) -> None:
    """Change a payload file and its hash in the manifest, but not the digest of it all."""
    swap(out)
    manifest = Manifest.read(out / MANIFEST_NAME)
    files = tuple(
        record.model_copy(update={"sha256": "0" * 64}) if record.path == "file-0.txt" else record
        for record in manifest.files
    )
    manifest.model_copy(update={"files": files}).write(out / MANIFEST_NAME)


EDITS: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "payload of another size": (lambda out: (out / "file-0.txt").write_text("x"), "1 bytes, the manifest says", "1 by"),
    "payload of the same size": (swap, "bytes changed since", "bytes changed since"),
    "payload and its hash": (forge, "manifest.json was edited", "bytes changed since"),
    "payload deleted": (lambda out: (out / "file-3.txt").unlink(), "file-3.txt: missing", "file-3.txt: missing"),
    "file added": (lambda out: (out / "new.txt").write_text("x"), "", "new.txt: not in the manifest"),
    "digest edited": (lambda out: edit_manifest(out, content_digest="0" * 64), "was edited", "does not match"),
    # without it, a folder with trajectory.tum is a trajectory from elsewhere
    "manifest deleted": (lambda out: (out / MANIFEST_NAME).unlink(), "", "not an artifact"),
    "manifest empty": (lambda out: (out / MANIFEST_NAME).write_text(""), "manifest.json", "manifest.json"),
    "manifest torn": (
        lambda out: (out / MANIFEST_NAME).write_bytes((out / MANIFEST_NAME).read_bytes()[:300]),
        "manifest.json",
        "man",
    ),
    "manifest without end": (lambda out: (out / MANIFEST_NAME).write_text("[" * 200_000), "manifest.json", "manifest"),
    "manifest of a list": (lambda out: (out / MANIFEST_NAME).write_text("[]"), "manifest.json", "manifest.json"),
    "manifest not text": (lambda out: (out / MANIFEST_NAME).write_bytes(b"\xff\xfe\x00"), "manifest.json", "manifest"),
    "manifest a folder": (
        lambda out: ((out / MANIFEST_NAME).unlink(), (out / MANIFEST_NAME).mkdir()),
        "a folder, not",
        "a folder, not",
    ),
    "size that is not a number": (
        lambda out: edit_manifest(out, schema_version=float("nan")),
        "schema_version",
        "schema",
    ),
    "path outside": (
        lambda out: edit_manifest(out, files=[{"path": "../x", "bytes": 1, "sha256": ""}]),
        "outside",
        "outside",
    ),
    "path absolute": (
        lambda out: edit_manifest(out, files=[{"path": "/etc/passwd", "bytes": 1, "sha256": ""}]),
        "outside",
        "outside",
    ),
    "path with a zero byte": (
        lambda out: edit_manifest(out, files=[{"path": "a\0b", "bytes": 1, "sha256": ""}]),
        "is not a path",
        "is not a path",
    ),
}


@pytest.mark.parametrize("case", EDITS)
def test_edited_artifacts(tmp_path: Path, case: str) -> None:
    """What a step that reads it says, what verify says, and that its own step repairs it without losing anything."""
    edit, reading, verifying = EDITS[case]
    make(tmp_path / "up")
    edit(tmp_path / "up")
    if reading:
        with pytest.raises(BadInput, match=reading) as caught:
            make(tmp_path / "down", {"upstream": tmp_path / "up"})
        assert "\n" not in str(caught.value) and not (tmp_path / "down").exists()
    else:  # a file that the manifest does not list is not read either
        assert make(tmp_path / "down", {"upstream": tmp_path / "up"}).status == "made"
    (finding,) = verify(tmp_path / "up")
    assert any(verifying in problem for problem in finding.problems), finding.problems
    if case == "manifest deleted":
        with pytest.raises(UsageError, match="no step wrote"):
            make(tmp_path / "up", force=True)
        return
    assert make(tmp_path / "up", force=True).status == "made"
    assert_sound(tmp_path / "up")


def test_a_manifest_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    make(tmp_path / "up")
    with (tmp_path / "up" / MANIFEST_NAME).open("r+b") as file:
        file.truncate(2**30)  # sparse
    started = time.monotonic()
    with pytest.raises(BadInput, match="larger than"):
        make(tmp_path / "down", {"upstream": tmp_path / "up"})
    assert time.monotonic() - started < 1 and LARGEST_MANIFEST < 2**30
    assert make(tmp_path / "up").status == "made"


def test_duplicate_keys_of_a_manifest_count_once(tmp_path: Path) -> None:
    """JSON leaves open which of two equal keys counts; here it is the last one, and the digest still has to fit."""
    make(tmp_path / "up")
    text = (tmp_path / "up" / MANIFEST_NAME).read_text()
    (tmp_path / "up" / MANIFEST_NAME).write_text('{"kind": "sequence", "content_digest": "0",' + text.lstrip()[1:])
    assert make(tmp_path / "down", {"upstream": tmp_path / "up"}).status == "made"
    assert_sound(tmp_path / "up")


def test_a_users_manifest_is_not_taken_for_ours(tmp_path: Path) -> None:
    """Many programs call a file manifest.json: a folder with such a one is never replaced."""
    for number, text in enumerate(['{"name": "my page", "icons": []}', "[1, 2]", "cut {"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / MANIFEST_NAME).write_text(text)
        (folder / "index.html").write_text("years of work")
        with pytest.raises(UsageError):
            make(folder, force=True)
        assert (folder / "index.html").read_text() == "years of work"


# --- inputs that change meanwhile ----------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["artifact", "same artifact", "file", "folder"])
def test_an_input_written_while_it_is_read(tmp_path: Path, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a step read is then of two minds: nothing is written, and the next run says what to do."""
    make(tmp_path / "up")
    log = tmp_path / "log"
    log.mkdir()
    (log / "a.png").write_bytes(b"1")
    inputs = (
        {"upstream": tmp_path / "up"} if "artifact" in what else {"log": log if what == "folder" else log / "a.png"}
    )
    make(tmp_path / "down", inputs)
    before = content(tmp_path / "down")
    work = runner._work

    def interrupted(*arguments):
        monkeypatch.setattr(runner, "_work", work)
        if what == "artifact":
            make(tmp_path / "up", text="other")
        elif what == "same artifact":
            make(tmp_path / "up", force=True)
        else:
            (log / ("a.png" if what == "file" else "b.png")).write_bytes(b"2")
        return work(*arguments)

    monkeypatch.setattr(runner, "_work", interrupted)
    if what == "same artifact":
        assert make(tmp_path / "down", inputs, text="b").status == "made"  # the same bytes: nothing was mixed
        return
    with pytest.raises(MachineFailure, match="was written while this step read it"):
        make(tmp_path / "down", inputs, text="b")
    assert content(tmp_path / "down") == before and beside(tmp_path / "down") == set()
    assert make(tmp_path / "down", inputs, text="b").status == "made"


# --- memory, libraries, signals, pipes -------------------------------------------------------------------------------


def test_out_of_memory(tmp_path: Path) -> None:
    make(tmp_path / "a")
    before = content(tmp_path / "a")
    done = run_probe("--out", tmp_path / "a", "--behaviour", "fill memory", limits=memory_limit(2**30))
    assert done.returncode == 6 and "out of memory" in only_error(done), done.stderr
    assert content(tmp_path / "a") == before and beside(tmp_path / "a") == set()


def test_a_disk_that_fills_up_while_a_folder_is_copied(tmp_path: Path) -> None:
    make(tmp_path / "a", text="0123456789")
    full = pytest.raises(MachineFailure, match="No space left on device")
    with small_disk(tmp_path / "disk", "size=64k") as disk, full, runner._machine_errors(disk):
        shutil.copytree(tmp_path / "a", disk / "copy")
    with pytest.raises(shutil.Error), runner._machine_errors(tmp_path):
        raise shutil.Error([("a", "b", "are the same file")])


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("libOpen3D.so: failed to map segment from shared object"),
        RuntimeError("[enforce fail at alloc_cpu.cpp] DefaultCPUAllocator: can't allocate memory: you tried"),
        RuntimeError("can't start new thread"),
        ValueError("Unable to allocate 7.3 GiB for an array"),
        RuntimeError("std::bad_alloc"),
    ],
    ids=repr,
)
def test_native_libraries_say_out_of_memory_in_their_own_words(error: Exception, tmp_path: Path) -> None:
    with pytest.raises(MachineFailure, match="out of memory"), runner._machine_errors(tmp_path):
        raise error
    with pytest.raises(ValueError, match="another"), runner._machine_errors(tmp_path):
        raise ValueError("another thing")


def test_a_missing_library_is_named(tmp_path: Path) -> None:
    done = run_probe("--out", tmp_path / "a", "--behaviour", "import nonsense")
    assert done.returncode == 5 and "nonsense" in only_error(done) and "scenewright doctor" in only_error(done)
    assert not (tmp_path / "a").exists() and beside(tmp_path / "a") == set()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("behaviour", ["write", "swallow interrupts", "turn interrupts into errors"])
def test_signals_end_a_run_even_when_their_exception_gets_lost(
    tmp_path: Path, number: signal.Signals, behaviour: str
) -> None:
    out = tmp_path / "a"
    make(out)
    before = content(out)
    words = ["probe", "--out", str(out), "--pause", "0.2", "--text", "b", "--behaviour", behaviour]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.reliability.probe_command", *words],
        cwd=REPOSITORY,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    while not list(tmp_path.glob(".a.partial-*/file-2.txt")) and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(number)
    output, errors = process.communicate(timeout=30)
    assert process.returncode == 130 and output == ""
    assert [line for line in errors.splitlines() if line.startswith("error:")] == [
        "error: interrupted; every finished artifact is as it was"
    ]
    assert "Traceback" not in errors
    assert content(out) == before and beside(out) == set()


def test_interruption_is_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interruption, "_requested", False)
    interruption.raise_if_requested()
    with pytest.raises(KeyboardInterrupt):
        interruption.interrupt(signal.SIGINT, None)
    with pytest.raises(KeyboardInterrupt):
        interruption.raise_if_requested()


def test_interruptions_wait_insist_and_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Signals of this very process: kept back while libraries load, repeated while a step swallows them, then gone."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)}
    hook = sys.unraisablehook
    monkeypatch.setattr(interruption, "_requested", False)
    monkeypatch.setattr(interruption, "REPEAT_SECONDS", 0.02)
    try:
        interruption.install()
        reached = False
        with pytest.raises(KeyboardInterrupt), interruption.waiting():
            signal.raise_signal(signal.SIGTERM)
            reached = True
        assert reached
        monkeypatch.setattr(interruption, "_requested", False)
        swallowed = 0
        with pytest.raises(KeyboardInterrupt), interruption.insisting():
            while True:
                try:
                    if not swallowed:
                        signal.raise_signal(signal.SIGINT)
                    time.sleep(5)
                except KeyboardInterrupt:
                    swallowed += 1
                    if swallowed == 3:
                        raise
        assert swallowed == 3
        time.sleep(0.1)  # nothing comes any more
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
        monkeypatch.setattr(interruption, "_requested", False)
        with interruption.waiting(), interruption.insisting():
            pass
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


IMPORT = """
class Numpy:
    def find_spec(self, name, path, target=None):
        if name == "numpy":
            try:
                os.kill(os.getpid(), signal.SIGINT)
                [None for _ in range(1000)]
            except KeyboardInterrupt:
                raise ImportError("failed to import") from None
sys.meta_path.insert(0, Numpy())
"""
"""numpy makes an import error of an interruption while it loads."""


@pytest.mark.parametrize("interrupted", [IMPORT, "main._run_and_exit = lambda: os.kill(os.getpid(), signal.SIGINT)\n"])
def test_an_interruption_while_code_loads_ends_in_one_line(interrupted: str) -> None:
    heard = "signal.signal(signal.SIGINT, signal.default_int_handler)"  # a shell's background jobs begin deaf to it
    script = f"import os, signal, sys\n{heard}\nfrom scenewright.cli import main\n{interrupted}main.main()\n"
    done = subprocess.run([sys.executable, "-c", script], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 130
    assert done.stderr == "error: interrupted; every finished artifact is as it was\n"


def test_an_interruption_lost_in_a_finalizer_prints_nothing() -> None:
    """The interpreter prints what a finalizer raises; of a repeated interruption nothing, of anything else all."""
    script = (
        "import os, signal\n"
        "from scenewright.stages.engine import interruption\n"
        "interruption.install()\n"
        "class Fails:\n"
        "    def __del__(self):\n"
        "        raise ValueError('of its own')\n"
        "class Slow:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        [None for _ in range(1000)]\n"
        "Fails()\n"
        "with interruption.insisting():\n"
        "    Slow()\n"
        "try:\n"
        "    interruption.raise_if_requested()\n"
        "except KeyboardInterrupt:\n"
        "    print('heard')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.stdout == "heard\n" and done.returncode == 0
    assert "of its own" in done.stderr and "KeyboardInterrupt" not in done.stderr


def test_a_reader_that_leaves(tmp_path: Path) -> None:
    """`| head -1`, and a pager that is closed while a step still talks: no traceback, code 130 at most."""
    make(tmp_path / "a")
    line = f"{sys.executable} -m scenewright inspect {tmp_path}/a"
    done = subprocess.run(["bash", "-c", f"{line} | head -1"], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.stdout.startswith("kind") and done.stderr == ""
    read, write = os.pipe()
    os.close(read)
    for streams in ({"stderr": write}, {"stdout": write, "stderr": write}):
        process = subprocess.Popen(
            [*line.split()],
            cwd=REPOSITORY,
            text=True,
            **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
        )
        _, errors = process.communicate(timeout=30)
        assert process.returncode in (0, 130) and "Traceback" not in (errors or "")
    os.close(write)
