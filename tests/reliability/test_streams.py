"""Standard streams that are closed, full or read by nobody, and surroundings that are not there: one line, one code."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from scenewright.cli.main import _check_surroundings
from scenewright.cli.streams import ReaderLeft, Stream
from scenewright.schemas.errors import MachineFailure
from scenewright.stages.engine import hub_cache, model_cache, runner

from tests.bad_input.hostile_artifacts import artifact
from tests.reliability.running import REPOSITORY

START = f"{shlex.quote(sys.executable)} -m scenewright"
NOISE = "pybullet build time"


def in_shell(line: str, folder: Path = REPOSITORY) -> tuple[int, list[str]]:
    """Run a line of bash; returns the exit code of the first command that failed, and what standard error said."""
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, [line for line in done.stderr.splitlines() if not line.startswith(NOISE)]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("--help >&-", 6, "standard output: Bad file descriptor"),
        ("fuse --help > /dev/full", 6, "standard output: No space left on device"),
        ("gc {runs} --json > /dev/full", 6, "standard output: No space left on device"),
        ("inspect {runs}/x --json <&- >&- 2>&-", 6, ""),
        ("verify {runs}/x >&- 2>&-", 0, ""),
        ("verify {runs}/x 2> /dev/full", 6, ""),
        ("nonsense 2>&-", 2, ""),
        ("inspect {runs}/wide --json | head -c1", 130, ""),
        ("diff {runs}/wide {runs}/x --json | true", 130, ""),
    ],
)
def test_streams_that_take_nothing(tmp_path: Path, words: str, code: int, said: str) -> None:
    artifact(tmp_path / "x")
    artifact(tmp_path / "wide", parameters={f"parameter_{number}": "x" * 100 for number in range(20_000)})
    found, lines = in_shell(f"{START} {words.format(runs=shlex.quote(str(tmp_path)))}")
    assert found == code, lines
    assert len(lines) == bool(said) and all(line.startswith("error: ") and said in line for line in lines)


def test_a_folder_that_is_gone(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    start = f"{shlex.quote(sys.executable)} -c 'from scenewright.cli.main import main; main()'"
    code, lines = in_shell(f"cd gone && rmdir ../gone && {start} gc", tmp_path)
    assert code == 6 and len(lines) == 1 and lines[0].startswith("error: the current folder: ")


def test_a_stream_fails_once(tmp_path: Path) -> None:
    stream = Stream(os.open("/dev/full", os.O_WRONLY), "standard output", clean=True, line_buffering=False)
    stream.write("text")
    with pytest.raises(MachineFailure, match="standard output: No space left"):
        stream.flush()
    stream.write("more")
    stream.flush()
    stream.close()


def test_a_reader_that_left() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    stream = Stream(writing, "standard output", clean=True, line_buffering=True)
    with pytest.raises(ReaderLeft) as left:
        stream.write("text\n")
    assert left.value.exit_code == 130
    stream.close()


@pytest.mark.parametrize("clean", [True, False])
def test_what_a_stream_lets_through(tmp_path: Path, clean: bool) -> None:
    path = tmp_path / "out"
    with Stream(
        os.open(path, os.O_WRONLY | os.O_CREAT), "standard output", clean=clean, line_buffering=False
    ) as stream:
        stream.write("\x1b[31mcaf\u00e9\udcff\n")
    assert path.read_bytes() == (b"\\u001b" if clean else b"\x1b") + b"[31mcaf\xc3\xa9\\udcff\n"


def test_the_current_folder_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    _check_surroundings()
    (tmp_path / "gone").rmdir()
    with pytest.raises(MachineFailure, match="the current folder"):
        _check_surroundings()


def test_without_a_home_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", no_home)
    for name in ("XDG_CACHE_HOME", "SCENEWRIGHT_MODELS", "HF_HUB_CACHE", "HF_HOME"):
        monkeypatch.delenv(name, raising=False)
    for folder in (model_cache.cache_folder, hub_cache.hub_folder):
        with pytest.raises(MachineFailure, match="no home folder is known .set HOME"):
            folder()


def test_compiled_code_that_can_be_kept_nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core import config
    from scenewright.stages.kit.compiled import compiled

    no_place = "IPythonCacheLocator"  # as when every folder for it is read-only: this one takes nothing of a file
    monkeypatch.setattr(config, "CACHE_LOCATOR_CLASSES", no_place)
    with pytest.raises(MachineFailure, match="NUMBA_CACHE_DIR"), runner._machine_errors(tmp_path):
        compiled(lambda number: number + 1)


NOBODY = (
    *("setpriv", "--reuid=54321", "--regid=54321", "--clear-groups"),
    *("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"),
)
"""Starts a command as somebody of whom the system knows nothing, not even a home, and who may read all and write
nothing of the program."""
GOLDEN = REPOSITORY / "tests" / "golden"
FUSE = ("fuse", "--sequence", GOLDEN / "v3" / "sequence", "--segments", GOLDEN / "v1" / "segments")


@pytest.mark.parametrize(
    "words, said", [(("models",), "no home folder is known (set HOME)"), (FUSE, "set NUMBA_CACHE_DIR")]
)
def test_a_user_without_a_home_and_without_a_place_for_compiled_code(words: tuple[str | Path, ...], said: str) -> None:
    if os.getuid() != 0 or subprocess.run([*NOBODY, "true"], capture_output=True).returncode != 0:
        pytest.skip("becoming nobody is not allowed here")
    place = Path(tempfile.mkdtemp())  # where others may enter, unlike a folder of pytest's
    place.chmod(0o777)
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("HOME", "XDG_", "NUMBA_"))}
    done = subprocess.run(
        [*NOBODY, sys.executable, "-B", "-c", "from scenewright.cli.main import main; main()", *map(str, words)]
        + (["--out", str(place / "out")] if words == FUSE else []),
        cwd="/",  # a folder that may not be written either: numba takes ~ for a folder of it
        env={**kept, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
    )
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert done.returncode == 6 and len(errors) == 1 and said in errors[0], done.stderr
    assert "Traceback" not in done.stderr and not (place / "out").exists()
    shutil.rmtree(place)
