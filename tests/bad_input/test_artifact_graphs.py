"""Artifacts that name each other, themselves, or what can be no input: each is visited once, and said in one line."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MOST_INPUTS
from scenewright.stages.engine import collection, store, verification
from scenewright.stages.engine.collection import survey
from scenewright.stages.engine.reading import open_artifact, read_manifest
from scenewright.stages.engine.verification import verify

from tests.bad_input.hostile_artifacts import artifact, chain, cycle, ladder, reads

ODD_INPUTS = {
    "zero byte": "a\0b",
    "long": "a" * 5000,
    "long name": "a" * 300,
    "empty": "",
    "own": "../x",
    "loop": "../l",
}
COMMANDS = ("inspect", "verify", "gc", "migrate", "timeline", "diff", "report")
CODES = (0, 2, 3, 6)


def command(name: str, folder: Path) -> list[str]:
    """Return the words that let a command read an artifact."""
    out = ["--out", str(folder.parent.parent / "out")]
    return {
        "gc": ["gc", str(folder.parent), "--superseded", "--intermediate"],
        "migrate": ["migrate", str(folder), *out],
        "diff": ["diff", str(folder), str(folder)],
        "report": ["report", "--sequence", str(folder), *out],
    }.get(name, [name, str(folder)])


@pytest.mark.parametrize("case", ODD_INPUTS)
def test_inputs_that_can_be_no_place(tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = artifact(tmp_path / "runs" / "x", ODD_INPUTS[case])
    (tmp_path / "runs" / "l").symlink_to("m")
    (tmp_path / "runs" / "m").symlink_to("l")
    assert run(["verify", str(folder)]) == 3
    assert "1 of 1 artifacts are damaged" in capsys.readouterr().err
    for name in COMMANDS:
        assert run(command(name, folder)) in CODES, capsys.readouterr().err
    if case in ("zero byte", "loop"):
        with pytest.raises(BadInput):
            assert Artifact(folder, manifest=read_manifest(folder)).inputs


def test_two_artifacts_that_name_each_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = cycle(tmp_path)
    assert run(["verify", str(first)]) == 3
    said = capsys.readouterr().err
    assert "leads back to" in said and "1 of 2 artifacts are damaged" in said
    for options in ({}, {"superseded": True}, {"intermediate": True}):
        items = survey([tmp_path], **options)
        assert [item.path.name for item in items] == ["first", "second"]
        assert all("circle" in item.reason and not item.collectable for item in items)


def test_what_is_made_from_a_circle_is_not_touched_either(tmp_path: Path) -> None:
    cycle(tmp_path)
    artifact(tmp_path / "a_user", "../first")
    artifact(tmp_path / "z_user", "../a_user")
    assert not any(item.collectable for item in survey([tmp_path], superseded=True, intermediate=True))


def test_ladders_are_climbed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts: Counter[Path] = Counter()

    def counted(root: Path):
        counts[Path(root)] += 1
        return read_manifest(root)

    top = ladder(tmp_path, 40)
    monkeypatch.setattr(verification, "read_manifest", counted)
    monkeypatch.setattr(collection, "read_manifest", counted)
    findings = verify(top)
    assert len(findings) == 41 and not any(finding.problems for finding in findings)
    assert max(counts.values()) <= 2  # as an input, and for itself
    started = time.process_time()
    assert len(survey([tmp_path], superseded=True, intermediate=True)) == 41
    assert time.process_time() - started < 5


def test_long_chains(tmp_path: Path) -> None:
    top = chain(tmp_path, 1100)
    assert len(verify(top)) == 1100
    artifact(tmp_path / "link_1099", content_digest="another")
    items = survey([tmp_path], superseded=True)
    assert len(items) == 1100 and sum(item.category == "superseded" for item in items) == 1099
    assert max(len(item.reason) for item in items) < 400


def test_shared_inputs_are_hashed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    log.write_text("a log")
    records = [{**record, "kind": "external"} for record in reads(*["../log"] * 50)]
    hashed: list[Path] = []
    monkeypatch.setattr(verification, "external_digest", lambda path: hashed.append(path) or "digest")
    verify(artifact(tmp_path / "x", inputs=records))
    assert hashed == [log.resolve()]


LARGE = 10**399
FIELDS = {
    "memory": {"provenance": {"peak_memory_bytes": LARGE}},
    "bytes": {"files": [{"path": "a", "bytes": LARGE, "sha256": "0"}]},
    "negative bytes": {"files": [{"path": "a", "bytes": -1, "sha256": "0"}]},
    "summary": {"summary": {"number": LARGE}},
    "parameters": {"parameters": {"number": LARGE}},
    "seed": {"seed": LARGE},
    "deep": {"summary": {"a": [[[[[[[[[[None]]]]]]]]]] * 1, "b": None}},
    "inputs": {"inputs": reads(*["../y"] * (MOST_INPUTS + 1))},
}
for _ in range(80):
    FIELDS["deep"]["summary"]["b"] = [FIELDS["deep"]["summary"]["b"]]


@pytest.mark.parametrize("case", FIELDS)
def test_numbers_and_counts_beyond_their_bounds(tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = artifact(tmp_path / "runs" / "x", **FIELDS[case])
    with pytest.raises(BadInput, match=r"manifest\.json"):
        read_manifest(folder)
    for name in ("verify", COMMANDS[list(FIELDS).index(case) % len(COMMANDS)]):
        assert run(command(name, folder)) in (0, 3), capsys.readouterr().err  # gc passes over it


@pytest.mark.parametrize("name", ["verify", "inspect", "gc", "diff"])
def test_escape_sequences_do_not_reach_the_terminal(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    odd = "\x1b]0;owned\x07\x1b[2J\x9b31m"
    folder = artifact(tmp_path / f"runs{odd}" / "x", f"../{odd}", kind="trajectory", key=odd)
    run(command(name, folder))
    run(command(name, artifact(tmp_path / "runs" / "y", kind=odd)))
    run(command(name, tmp_path / odd))
    said = capsys.readouterr()
    assert said.err + said.out and not {"\x1b", "\x07", "\x9b"} & set(said.err + said.out)


@pytest.mark.parametrize("name", ["manifest.json", "journal"])
@pytest.mark.parametrize("what", ["a pipe", "a device", "large"])
def test_bookkeeping_that_is_no_file(tmp_path: Path, name: str, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = artifact(tmp_path / "runs" / "x")
    path = folder / name if name == "manifest.json" else folder.parent / ".x.journal"
    path.unlink(missing_ok=True)
    if what == "a pipe":
        os.mkfifo(path)
    elif what == "a device":
        path.symlink_to("/dev/zero")
    else:
        path.touch()
        os.truncate(path, 10 * 2**30)
    (folder.parent / ".x.lock").touch()
    for command_name in COMMANDS:
        assert run(command(command_name, folder)) in (0, 3), capsys.readouterr().err
    with pytest.raises(BadInput):
        open_artifact(folder)


@pytest.mark.parametrize("plan", ['{"partial": "..", "old": ".."}', '{"partial": ".y.old-00000000", "old": "x"}', "[]"])
def test_a_journal_moves_nothing_that_is_not_its_own(tmp_path: Path, plan: str) -> None:
    artifact(tmp_path / "y")
    (tmp_path / ".x.journal").write_text(plan)
    store.complete_interrupted(tmp_path / "x")
    assert not (tmp_path / "x").exists() and not (tmp_path / ".x.journal").exists()
    assert read_manifest(tmp_path / "y").kind == "trajectory"


@pytest.mark.parametrize("name", COMMANDS)
def test_names_of_5000_letters(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    long = "x" * 5000
    words = {
        "diff": ["diff", long, str(tmp_path)],
        "report": ["report", "--sequence", long, "--out", str(tmp_path / "o")],
        "migrate": ["migrate", long, "--out", str(tmp_path / "o")],
    }.get(name, [name, long])
    assert run(words) == 3
    assert capsys.readouterr().err.count("error: ") == 1
    assert run(["makefile", long]) == 2 and run(["run", long, "--out", str(tmp_path)]) == 2


def test_the_root_folder_is_no_artifact(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diff", "/", "/"]) == 3
