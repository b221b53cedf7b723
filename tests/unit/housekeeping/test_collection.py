"""`gc`: what it lists, what it deletes, and above all what it leaves alone."""

from __future__ import annotations

import fcntl
import json
import os
import random
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.stages.engine import collection
from scenewright.stages.engine.collection import collect, survey
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.engine.verification import verify

from tests.unit.housekeeping.artifacts import snapshot
from tests.unit.housekeeping.small_step import SMALL, SmallParameters


@pytest.fixture(autouse=True)
def _small_is_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collection, "all_stages", lambda: {"small": SMALL})


def make(out: Path, inputs: dict[str, Path] | None = None, **values) -> Path:
    run_stage(SMALL, inputs or {}, out, SmallParameters(**values))
    return out


def chain(folder: Path) -> Path:
    """A log, and three artifacts one after the other."""
    folder.mkdir(parents=True)
    (folder / "room.log").write_text("log")
    make(folder / "a", {"log": folder / "room.log"})
    make(folder / "b", {"upstream": folder / "a"})
    make(folder / "c", {"upstream": folder / "b"})
    return folder


def leave_partial(target: Path, name: str = "partial-123-0123abcd", size: int = 1000) -> Path:
    leftover = target.with_name(f".{target.name}.{name}")
    leftover.mkdir(parents=True)
    (leftover / "half.bin").write_bytes(b"x" * size)
    target.with_name(f".{target.name}.lock").touch()
    return leftover


@contextmanager
def held(target: Path) -> Iterator[None]:
    descriptor = os.open(target.with_name(f".{target.name}.lock"), os.O_RDWR | os.O_CREAT)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    yield
    os.close(descriptor)


def categories(items: list) -> dict[str, tuple[str, bool]]:
    return {item.path.name: (item.category, item.collectable) for item in items}


def test_listing_writes_nothing(tmp_path: Path) -> None:
    chain(tmp_path / "run")
    leave_partial(tmp_path / "run" / "d")
    before = snapshot(tmp_path)
    found = survey([tmp_path], superseded=True, intermediate=True)
    assert categories(found) == {
        "d": ("leftover", True),
        "a": ("intermediate", True),
        "b": ("intermediate", True),
        "c": ("result", False),
    }
    assert snapshot(tmp_path) == before
    assert next(item for item in found if item.category == "leftover").bytes == 1000


def test_by_default_only_leftovers_go(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    leftovers = [leave_partial(folder / "b"), leave_partial(folder / "b", "old-89abcdef"), leave_partial(folder / "x")]
    gone, stayed = collect(survey([tmp_path]))
    assert not stayed and sum(item.bytes for item in gone) == 3000
    assert not [path for path in leftovers if path.exists()]
    for name in "abc":
        assert verify(folder / name)[0].problems == ()


def test_what_is_locked_is_left_alone(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    leftover = leave_partial(folder / "b")
    with held(folder / "b"):
        items = survey([folder], intermediate=True)
        assert categories(items)["a"] == ("intermediate", True)
        assert all(not item.collectable for item in items if item.path.name == "b")
        assert leftover.exists()
    items = survey([folder], intermediate=True)
    with held(folder / "b"):  # a run that starts between the look and the deletion
        gone, stayed = collect(items)
        assert {item.path.name for item in stayed} == {"b"} and "another run" in stayed[0].reason
        assert leftover.exists() and (folder / "b" / MANIFEST_NAME).exists()


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    for path in (
        folder / ".thesis.partial-1-00000000",  # our pattern, but no step ever locked that name
        folder / ".c.partial-final",
        folder / "old-0123abcd",
        folder / "notes",
    ):
        path.mkdir()
        (path / "chapter.txt").write_text("years of work")
    (folder / "elsewhere").symlink_to(tmp_path / "outside")
    leave_partial(tmp_path / "outside" / "z")
    (folder / "odd").mkdir()
    (folder / "odd" / MANIFEST_NAME).write_text('{"name": "some web page"}')
    before = snapshot(tmp_path)
    found = survey([folder])
    assert set(categories(found)) == {"a", "b", "c"}
    collect(found)
    assert snapshot(tmp_path) == before


def test_intermediate_artifacts_go_and_come_back_the_same(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    digests = {name: Manifest.read(folder / name / MANIFEST_NAME).content_digest for name in "abc"}
    gone, stayed = collect(survey([folder], intermediate=True))
    assert {item.path.name for item in gone} == {"a", "b"} and not stayed
    assert sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) == ["c", "room.log"]
    make(folder / "a", {"log": folder / "room.log"})
    make(folder / "b", {"upstream": folder / "a"})
    result = run_stage(SMALL, {"upstream": folder / "b"}, folder / "c", SmallParameters())
    assert result.status == "up to date"
    assert digests == {name: Manifest.read(folder / name / MANIFEST_NAME).content_digest for name in "abc"}


def test_kinds_to_keep(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    assert not [item for item in survey([folder], intermediate=True, keep=["trajectory"]) if item.collectable]
    with pytest.raises(BadInput, match="no kind 'nonsense'"):
        survey([folder], keep=["nonsense"])


@pytest.mark.parametrize("change", ["log gone", "log edited", "code", "key"])
def test_what_cannot_be_remade_stays(tmp_path: Path, change: str) -> None:
    folder = chain(tmp_path / "run")
    if change == "log gone":
        (folder / "room.log").unlink()
    elif change == "log edited":
        (folder / "room.log").write_text("gol")
    else:
        manifest = Manifest.read(folder / "a" / MANIFEST_NAME)
        update = {"code": "another"} if change == "code" else {"libraries": {}, "key": "another"}
        manifest.model_copy(update=update).write(folder / "a" / MANIFEST_NAME)
    collect(survey([folder], intermediate=True))
    assert (folder / "a" / MANIFEST_NAME).exists() and not (folder / "b").exists()


def test_superseded_artifacts(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    make(folder / "a", {"log": folder / "room.log"}, text="other")
    found = survey([folder], superseded=True, intermediate=True)
    assert categories(found) == {"a": ("intermediate", True), "b": ("superseded", True), "c": ("superseded", True)}
    assert categories(survey([folder]))["c"] == ("superseded", False)
    collect(survey([folder], superseded=True))
    assert (folder / "a").exists() and not (folder / "b").exists() and not (folder / "c").exists()


def test_what_another_run_reads_counts(tmp_path: Path) -> None:
    """An artifact that only a neighbouring run reads is intermediate, not a result; superseded, it stays."""
    folder = chain(tmp_path / "run")
    make(tmp_path / "other" / "d", {"upstream": folder / "c"})
    assert categories(survey([folder]))["c"] == ("intermediate", False)
    make(folder / "b", {"upstream": folder / "a"}, text="other")
    found = {item.path.name: item for item in survey([folder], superseded=True)}
    assert found["c"].category == "superseded" and not found["c"].collectable and "d" in found["c"].reason


def test_made_again_between_look_and_deletion(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    items = survey([folder], intermediate=True)
    make(folder / "b", {"upstream": folder / "a"}, text="newer")
    _, stayed = collect(items)
    assert [item.path.name for item in stayed] == ["b"] and "meanwhile" in stayed[0].reason
    assert verify(folder / "b")[0].problems == ()


def test_an_interrupted_replacement_is_completed_not_lost(tmp_path: Path) -> None:
    folder = chain(tmp_path / "run")
    make(tmp_path / "new" / "c", text="new")
    partial, old = folder / ".c.partial-1-0123abcd", folder / ".c.old-0123abcd"
    shutil.move(tmp_path / "new" / "c", partial)
    os.rename(folder / "c", old)
    (folder / ".c.journal").write_text(json.dumps({"partial": partial.name, "old": old.name}))
    items = [item for item in survey([folder]) if item.category == "leftover"]
    assert items[0].bytes == 0 and "interrupted" in items[0].reason
    collect(items)
    assert Manifest.read(folder / "c" / MANIFEST_NAME).parameters["text"] == "new"
    assert sorted(p.name for p in folder.iterdir()) == [".a.lock", ".b.lock", ".c.lock", "a", "b", "c", "room.log"]


def test_killed_while_deleting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What gc itself leaves when it is killed is a leftover for the next one; artifacts are there whole or not."""
    folder = chain(tmp_path / "run")

    def die(path: Path) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(collection.shutil, "rmtree", die)
        with pytest.raises(KeyboardInterrupt):
            collect(survey([folder], intermediate=True))
    remaining = categories(survey([folder]))
    assert remaining["a"][0] == "leftover" and remaining["c"] == ("result", False)
    collect(survey([folder]))
    assert not [p for p in folder.iterdir() if ".old-" in p.name]


def test_random_folders_of_runs(tmp_path: Path) -> None:
    """Whatever goes: every artifact that stays is sound, and what it reads is there or can be made again."""
    rng = random.Random(11)
    for number in range(6):
        root = tmp_path / str(number)
        made: list[Path] = []
        for index in range(8):
            run_folder = root / f"run{rng.randrange(2)}"
            inputs = {"upstream": rng.choice(made)} if made and rng.random() < 0.8 else {}
            made.append(make(run_folder / f"s{index}", inputs, text=str(index)))
        if rng.random() < 0.7:
            make(rng.choice(made), text="again")
        options = {"superseded": rng.random() < 0.5, "intermediate": rng.random() < 0.5}
        items = survey([root / f"run{rng.randrange(2)}"] if rng.random() < 0.5 else [root], **options)
        collect(items)
        for item in items:
            assert item.path.exists() != item.collectable
        for path in made:
            if path.exists():
                problems = [p for finding in verify(path)[:1] for p in finding.problems]
                assert not [p for p in problems if "bytes" in p or "missing" in p], problems
        assert not [item for item in items if item.category == "result" and item.collectable]


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = chain(tmp_path / "run")
    leave_partial(folder / "b", size=2_000_000)
    assert run(["gc", str(folder)]) == 0
    assert "--delete frees 2.0 MB" in capsys.readouterr().out
    assert run(["gc", str(folder), "--json", "--delete"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["freed_bytes"] == 2_000_000 and document["failed"] == []
    assert run(["gc", str(tmp_path / "nowhere")]) == 3
