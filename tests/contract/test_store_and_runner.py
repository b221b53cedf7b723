"""The artifact contract: whole or not at all, resume by key, digests, errors. Every claim is tested by breaking it."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import time
from dataclasses import replace
from pathlib import Path

import pytest
from scenewright.schemas.errors import BadInput, MachineFailure, UsageError
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.schemas.vocabulary import VOCABULARY_FILE
from scenewright.stages.engine import store
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.runner import RunResult, run_stage
from scenewright.stages.engine.verification import verify

from tests.contract.probe_step import PROBE, ProbeParameters

FORK = multiprocessing.get_context("fork")


def make(
    out: Path, inputs: dict[str, Path] | None = None, *, force: bool = False, dry_run: bool = False, **values
) -> RunResult:
    return run_stage(PROBE, inputs or {}, out, ProbeParameters(**values), force=force, dry_run=dry_run)


def assert_sound(out: Path) -> None:
    for finding in verify(out):
        assert finding.problems == ()


def snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    return {str(p): (p.stat().st_mtime_ns, p.stat().st_size) for p in sorted(folder.rglob("*"))}


def leftovers(out: Path) -> list[str]:
    return [p.name for p in out.parent.iterdir() if p.name not in (out.name, f".{out.name}.lock")]


def test_made_then_up_to_date_then_changed(tmp_path: Path) -> None:
    out = tmp_path / "artifact"
    first = make(out)
    assert first.status == "made" and first.manifest is not None
    before = snapshot(tmp_path)
    again = make(out)
    assert again.status == "up to date" and snapshot(tmp_path) == before
    changed = make(out, text="b")
    assert changed.status == "made" and "parameter text 'a' -> 'b'" in changed.reason
    assert changed.key != first.key and changed.manifest.content_digest != first.manifest.content_digest
    assert_sound(out)
    assert leftovers(out) == []


def test_force_makes_it_again_with_the_same_digest(tmp_path: Path) -> None:
    first, again = make(tmp_path / "a"), make(tmp_path / "a", force=True)
    assert again.status == "made" and again.reason == "--force"
    assert again.manifest.content_digest == first.manifest.content_digest and not again.nondeterministic


def test_a_nondeterministic_step_is_reported(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(tmp_path / "a", behaviour="random")
    assert make(tmp_path / "a", behaviour="random", force=True).nondeterministic


def test_what_runs_share_is_made_once_and_is_the_same(tmp_path: Path) -> None:
    def run(name: str, **values) -> RunResult:
        return run_stage(PROBE, {}, tmp_path / name, ProbeParameters(**values), shared=tmp_path / ".shared")

    first, second = run("a"), run("b")
    assert (first.status, second.status) == ("made", "taken")
    assert second.manifest.content_digest == first.manifest.content_digest and second.key == first.key
    assert_sound(tmp_path / "b")
    assert run("b").status == "up to date"
    assert run("c", text="other").status == "made"  # another key
    (kept,) = [path for path in (tmp_path / ".shared").glob("probe*") if path.name.endswith(first.key[:16])]
    payload = next(path for path in kept.iterdir() if path.name.startswith("file-"))
    payload.write_bytes(b"z" * payload.stat().st_size)  # the same size
    assert run("d").status == "made"  # what is damaged is not taken, and mended
    assert_sound(tmp_path / "d")
    assert run("e").status == "taken"
    with pytest.raises(UsageError, match="without inputs"):
        run_stage(PROBE, {"upstream": tmp_path / "a"}, tmp_path / "f", ProbeParameters(), shared=tmp_path / ".shared")


def test_dry_run_writes_nothing(tmp_path: Path) -> None:
    result = make(tmp_path / "a", dry_run=True)
    assert result.status == "would run" and result.reason == "nothing is made yet"
    assert list(tmp_path.iterdir()) == []
    make(tmp_path / "a")
    before = snapshot(tmp_path)
    assert make(tmp_path / "a", dry_run=True).status == "up to date"
    assert make(tmp_path / "a", dry_run=True, text="c").status == "would run"
    assert snapshot(tmp_path) == before


def test_failure_leaves_the_previous_artifact(tmp_path: Path) -> None:
    out = tmp_path / "a"
    make(out)
    before = snapshot(out)
    with pytest.raises(RuntimeError):
        make(out, behaviour="raise")
    assert snapshot(out) == before and leftovers(out) == []
    assert_sound(out)


def test_negative_outcome_is_a_complete_artifact(tmp_path: Path) -> None:
    result = make(tmp_path / "a", behaviour="empty")
    assert result.outcome == "empty" and result.manifest.summary["reason"]
    assert_sound(tmp_path / "a")
    assert make(tmp_path / "a", behaviour="empty").status == "up to date"


def test_upstream_remade_with_the_same_result_stops_there(tmp_path: Path) -> None:
    make(tmp_path / "up")
    first = make(tmp_path / "down", {"upstream": tmp_path / "up"})
    make(tmp_path / "up", force=True)
    assert make(tmp_path / "down", {"upstream": tmp_path / "up"}).status == "up to date"
    make(tmp_path / "up", text="z")
    changed = make(tmp_path / "down", {"upstream": tmp_path / "up"})
    assert changed.status == "made" and "input upstream" in changed.reason and changed.key != first.key


def test_key_covers_file_content_not_its_name(tmp_path: Path) -> None:
    (tmp_path / "one.log").write_text("log")
    (tmp_path / "two.log").write_text("log")
    first = make(tmp_path / "a", {"log": tmp_path / "one.log"})
    assert make(tmp_path / "a", {"log": tmp_path / "two.log"}).status == "up to date"
    (tmp_path / "two.log").write_text("gol")
    assert make(tmp_path / "a", {"log": tmp_path / "two.log"}).key != first.key


def test_two_runs_on_one_output(tmp_path: Path) -> None:
    out = tmp_path / "a"
    slow = FORK.Process(target=make, args=(out,), kwargs={"pause": 0.2})
    slow.start()
    deadline = time.monotonic() + 10
    while not list(tmp_path.glob(".a.partial-*")) and time.monotonic() < deadline:
        time.sleep(0.005)
    with pytest.raises(MachineFailure, match="another run is writing it"):
        make(out)
    slow.join()
    assert slow.exitcode == 0
    assert_sound(out)


def _run_quietly(out: Path, text: str, pause: float) -> None:
    make(out, text=text, pause=pause)


@pytest.mark.parametrize("atomic_exchange", [True, False])
def test_sigkill_at_many_random_moments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, atomic_exchange: bool) -> None:
    """Whenever it is killed, what stands there is a sound artifact, the old one or the new one."""
    if not atomic_exchange:
        monkeypatch.setattr(store, "exchange", lambda first, second: False)
    out = tmp_path / "a"
    texts = ["old"]
    make(out, text="old")
    rng = random.Random(5)
    finished = killed = 0
    for number in range(60):
        text = f"text {number} "
        process = FORK.Process(target=_run_quietly, args=(out, text, 0.001))
        process.start()
        time.sleep(rng.uniform(0.0, 0.12))
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        finished, killed = finished + (process.exitcode == 0), killed + (process.exitcode != 0)
        with store.locked(out):  # what the next run does first
            pass
        assert_sound(out)
        found = Manifest.read(out / MANIFEST_NAME).parameters["text"]
        assert found in (texts[-1], text)
        texts.append(found)
    assert killed >= 10, f"{killed} kills of 60 hit: the test has to interrupt more often"
    make(out, text="last", force=True)
    assert leftovers(out) == []


def test_sigkill_before_the_first_artifact_leaves_none(tmp_path: Path) -> None:
    out = tmp_path / "a"
    process = FORK.Process(target=_run_quietly, args=(out, "x", 0.2))
    process.start()
    while not list(tmp_path.glob(".a.partial-*/file-1.txt")):
        time.sleep(0.005)
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert not out.exists()
    assert make(out).status == "made" and leftovers(out) == []


@pytest.mark.parametrize("stop_after", ["journal", "first rename", "second rename"])
def test_interrupted_replacement_is_completed(tmp_path: Path, stop_after: str) -> None:
    """Every state that a kill can leave of the journalled pair of renames."""
    out = tmp_path / "a"
    make(out, text="old")
    make(tmp_path / "new", text="new")
    partial, old = tmp_path / ".a.partial-1-0123abcd", tmp_path / ".a.old-0123abcd"
    shutil.move(tmp_path / "new", partial)
    (tmp_path / ".a.journal").write_text(json.dumps({"partial": partial.name, "old": old.name}))
    if stop_after != "journal":
        os.rename(out, old)
    if stop_after == "second rename":
        os.rename(partial, out)
    findings = verify(out)  # a reader completes it
    assert findings[0].problems == ()
    expected = "old" if stop_after == "journal" else "new"
    assert Manifest.read(out / MANIFEST_NAME).parameters["text"] == expected
    assert not (tmp_path / ".a.journal").exists()


def _limited(out: Path, result: multiprocessing.SimpleQueue) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
    try:
        make(out, text="longer text that does not fit")
    except MachineFailure as error:
        result.put(error.message)


def test_full_disk_leaves_the_previous_artifact(tmp_path: Path) -> None:
    out = tmp_path / "a"
    make(out)
    result = FORK.SimpleQueue()
    process = FORK.Process(target=_limited, args=(out, result))
    process.start()
    process.join()
    assert "File too large" in result.get()
    assert_sound(out)
    assert leftovers(out) == []


def test_unwritable_output_is_a_machine_failure() -> None:
    with pytest.raises(MachineFailure):
        make(Path("/proc/nowhere/artifact"))


def test_foreign_folders_are_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("years of work")
    with pytest.raises(UsageError, match="no step wrote"):
        make(tmp_path / "thesis", force=True)
    assert (tmp_path / "thesis" / "chapter.txt").read_text() == "years of work"
    make(tmp_path / "other")
    manifest = json.loads((tmp_path / "other" / MANIFEST_NAME).read_text())
    (tmp_path / "other" / MANIFEST_NAME).write_text(json.dumps({**manifest, "kind": "sequence"}))
    with pytest.raises(UsageError, match="'sequence'"):
        make(tmp_path / "other")


@pytest.mark.parametrize("damage", ["bit flip", "truncated", "deleted", "added", "manifest"])
def test_verify_finds_every_damage(tmp_path: Path, damage: str) -> None:
    out = tmp_path / "a"
    make(out)
    file = out / "file-3.txt"
    if damage == "bit flip":
        data = bytearray(file.read_bytes())
        data[100] ^= 1
        file.write_bytes(data)
    elif damage == "truncated":
        file.write_bytes(file.read_bytes()[:-1])
    elif damage == "deleted":
        file.unlink()
    elif damage == "added":
        (out / "extra.txt").write_text("x")
    else:
        text = (out / MANIFEST_NAME).read_text()
        (out / MANIFEST_NAME).write_text(text.replace("file-3.txt", "file-9.txt"))
    assert verify(out)[0].problems
    if damage in ("truncated", "deleted"):
        with pytest.raises(BadInput):
            make(tmp_path / "down", {"upstream": out})
        assert make(out).status == "made"  # the step notices and repairs


def test_verify_follows_inputs_back(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("log")
    make(tmp_path / "up", {"log": tmp_path / "a.log"})
    make(tmp_path / "down", {"upstream": tmp_path / "up"})
    assert [finding.path.name for finding in verify(tmp_path / "down")] == ["down", "up"]
    (tmp_path / "a.log").write_text("gol")
    problems = [problem for finding in verify(tmp_path / "down") for problem in finding.problems]
    assert len(problems) == 1 and "a.log" in problems[0]


def test_a_moved_run_still_verifies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(all_stages(), "probe", PROBE)
    make(tmp_path / "run" / "up")
    make(tmp_path / "run" / "down", {"upstream": tmp_path / "run" / "up"})
    shutil.move(tmp_path / "run", tmp_path / "moved")
    for finding in verify(tmp_path / "moved" / "down"):
        assert finding.problems == () and finding.notes == ()


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"format_version": 99}, "upgrade"),
        ({"schema_version": 99}, "upgrade"),
        ({"schema_version": 0}, "scenewright migrate"),
        ({"kind": "nonsense"}, "unknown kind"),
        ({"kind": "sequence"}, "trajectory"),
        ({"extra": 1}, "extra"),
    ],
)
def test_wrong_inputs_are_refused_in_one_line(tmp_path: Path, change: dict, match: str) -> None:
    make(tmp_path / "up")
    manifest = json.loads((tmp_path / "up" / MANIFEST_NAME).read_text())
    (tmp_path / "up" / MANIFEST_NAME).write_text(json.dumps({**manifest, **change}))
    with pytest.raises(BadInput, match=match) as caught:
        make(tmp_path / "down", {"upstream": tmp_path / "up"})
    assert "\n" not in str(caught.value) and not (tmp_path / "down").exists()


def test_links_in_artifacts_are_refused(tmp_path: Path) -> None:
    make(tmp_path / "a")
    (tmp_path / "secret").write_text("x" * (tmp_path / "a" / "file-0.txt").stat().st_size)
    (tmp_path / "a" / "file-0.txt").unlink()
    (tmp_path / "a" / "file-0.txt").symlink_to(tmp_path / "secret")
    with pytest.raises(BadInput, match="outside"):
        make(tmp_path / "down", {"upstream": tmp_path / "a"})


def test_key_covers_the_content_of_data_files(tmp_path: Path) -> None:
    """A recipe edited under the same name makes another artifact; a missing one is a usage error."""
    recipe = VOCABULARY_FILE.parent / "recipes" / "contract_test.toml"
    stage = replace(PROBE, data_files=lambda parameters: ("recipes/contract_test.toml",))
    with pytest.raises(UsageError, match=r"contract_test\.toml"):
        run_stage(stage, {}, tmp_path / "a", ProbeParameters())
    try:
        recipe.write_text("a = 1\n")
        first = run_stage(stage, {}, tmp_path / "a", ProbeParameters())
        assert run_stage(stage, {}, tmp_path / "a", ProbeParameters()).status == "up to date"
        recipe.write_text("a = 2\n")
        again = run_stage(stage, {}, tmp_path / "a", ProbeParameters())
    finally:
        recipe.unlink(missing_ok=True)
    assert again.key != first.key and "data file recipes/contract_test.toml" in again.reason
