"""What is shown while a batch runs."""

from __future__ import annotations

import io
from pathlib import Path

from rich.console import Console
from scenewright.stages.engine.batch.display import Count, LineDisplay, TableDisplay, describe, display_for
from scenewright.stages.engine.batch.scene_log import LOG_NAME, LogFollower

from tests.unit.batch.batches import job, result


def test_plain_lines() -> None:
    said: list[str] = []
    with LineDisplay(2, said.append) as display:
        display.submitted(job("a"))
        display.finished(result("a"))
        display.finished(result("b", "bad input", reason="no depth", failed_step="sequence"))
    assert said[0] == "scene a" and said[1].startswith("[1/2, 1 done, ") and "to go" in said[1]
    assert said[2] == "[2/2, 1 done, 1 explained] bad input: b (1.0 s) sequence: no depth"
    assert describe(result("a", outcomes={"plan": "infeasible"})) == "done: a (1.0 s) plan: infeasible"


def test_time_to_go() -> None:
    clock = iter([100.0, 130.0])
    count = Count(4, lambda: next(clock))
    assert count.remaining_seconds() is None
    count.take(result("a"))
    assert count.remaining_seconds() == 90.0


def test_the_table_follows_the_logs(tmp_path: Path) -> None:
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100)
    running = job("[bold]a", folder=str(tmp_path), steps=("sequence", "segments"))
    (tmp_path / LOG_NAME).write_text("[1/2] sequence\n[2/2] segments\n")
    with TableDisplay(3, console) as display:
        display.submitted(running)
        display.tick()
        with (tmp_path / LOG_NAME).open("a") as log:
            log.write("[1/2] sequence\n[9/9] nonsense\n")
        table = display.table(1e9)
        drawn = io.StringIO()
        Console(file=drawn, width=100).print(table)
        display.finished(result("[bold]a", "crash", reason="died of SIGSEGV"))
    text = drawn.getvalue()
    assert "[bold]a" in text and "sequence" in text and "nonsense" not in text and "segments" not in text
    assert "died of SIGSEGV" in stream.getvalue()


def test_quiet_says_nothing() -> None:
    with display_for(1, lambda text: 1 / 0, terminal=True, quiet=True) as display:
        display.submitted(job("a"))
        display.finished(result("a"))


def test_a_log_is_read_once_and_whole_lines_only(tmp_path: Path) -> None:
    path = tmp_path / "log"
    follower = LogFollower(path, ("sequence", "segments"))
    follower.look()
    path.write_bytes(b"[1/2] sequence\nerror: one\n[2/2] seg")
    follower.look()
    assert (follower.step, follower.error) == ("sequence", "one")
    with path.open("ab") as log:
        log.write(b"ments\nsome words")
    follower.look()
    assert (follower.step, follower.error, follower.last_line) == ("segments", None, "error: one")
    follower.look(final=True)
    assert follower.last_line == "some words" and follower.position == path.stat().st_size
