"""`--max-memory`: the step stops, says so in one line, and leaves nothing; below the limit nothing happens."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.schemas.errors import MachineFailure, UsageError
from scenewright.stages.engine import memory_limit
from scenewright.stages.engine.memory_limit import limited, parse_limit, resident_memory_bytes

OUT = Path("/somewhere/map")
MEBIBYTE = 2**20


def grow(mebibytes: int) -> list[np.ndarray]:
    """Touch so much memory, 4 MiB at a time, slowly enough to be watched."""
    kept = []
    for _ in range(mebibytes // 4):
        kept.append(np.ones(4 * MEBIBYTE, np.uint8))
        time.sleep(0.005)
    return kept


def test_resident_memory_is_what_was_touched() -> None:
    before = resident_memory_bytes()
    kept = np.ones(200 * MEBIBYTE, np.uint8)
    assert resident_memory_bytes() - before == pytest.approx(kept.nbytes, rel=0.1)


def test_the_step_is_stopped_and_says_so() -> None:
    before = signal.getsignal(signal.SIGUSR1)
    with (
        pytest.raises(MachineFailure, match="more than --max-memory") as caught,
        limited(resident_memory_bytes() + 100 * MEBIBYTE, OUT),
    ):
        grow(1200)
    assert str(OUT) in str(caught.value) and "\n" not in str(caught.value) and caught.value.exit_code == 6
    assert signal.getsignal(signal.SIGUSR1) == before


def test_below_the_limit_nothing_happens() -> None:
    with limited(resident_memory_bytes() + 500 * MEBIBYTE, OUT):
        kept = grow(60)
    with limited(None, OUT):
        kept += grow(4)
    assert len(kept) == 16


def test_a_step_that_swallows_the_interruption_fails_all_the_same() -> None:
    limit = resident_memory_bytes() + 40 * MEBIBYTE
    with pytest.raises(MachineFailure), limited(limit, OUT), contextlib.suppress(BaseException):
        grow(600)


def test_other_exceptions_pass_through() -> None:
    with pytest.raises(KeyboardInterrupt), limited(2**50, OUT):
        raise KeyboardInterrupt


def test_a_step_that_cannot_be_interrupted_is_ended() -> None:
    code = (
        "import signal, time, numpy; from pathlib import Path;"
        "from scenewright.stages.engine import memory_limit as m\n"
        "m.GRACE_SECONDS = 0.5\n"
        "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])\n"
        "with m.limited(m.resident_memory_bytes() + 2**20, Path('map')):\n"
        "    kept = numpy.ones(2**27, numpy.uint8); time.sleep(30)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=20)
    assert done.returncode == 6 and done.stderr.startswith("error: ") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(("text", "expected"), [("4GiB", 2**32), ("500 MB", 500_000_000), ("1.5GiB", 3 * 2**29)])
def test_limits_as_people_write_them(text: str, expected: int) -> None:
    assert parse_limit(text) == expected


@pytest.mark.parametrize("text", ["", "4", "GiB", "-1GiB", "0 MB", "4 gigs", "nan GiB"])
def test_limits_that_are_none(text: str) -> None:
    with pytest.raises(UsageError, match="--max-memory"):
        parse_limit(text)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A real step under a limit that the interpreter alone passes."""
    monkeypatch.setattr(memory_limit, "SECONDS_BETWEEN_LOOKS", 0.005)
    assert run(["library", "build", "--out", str(tmp_path / "library"), "--max-memory", "20MiB", "--quiet"]) == 6
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and "--max-memory 20 MiB" in errors[0]
    assert [path.name for path in tmp_path.iterdir()] == [".library.lock"]
