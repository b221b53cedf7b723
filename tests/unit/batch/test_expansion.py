"""From a batch file to its runs; everything wrong is found before anything runs."""

from __future__ import annotations

import os
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.expansion import make_jobs, read_batch, shuffled
from scenewright.stages.engine.batch.spec import (
    BatchSpec,
    DataSpec,
    Limits,
    LocalOptions,
    RayOptions,
    SlurmOptions,
    check_spec,
)

from tests.unit.batch.batches import batch_of, write_batch

SETS = '[[parameters]]\nname = "fine"\nset = { every = 1 }\n[[parameters]]\nname = "coarse"\nset = { every = 5 }\n'


def test_scenes_times_parameters_times_seeds(tmp_path: Path) -> None:
    batch = batch_of(tmp_path, {"a": "write", "b": "write"}, SETS, 'seeds = "1-3"')
    assert len(batch.runs) == 2 * 2 * 3
    assert {run.name for run in batch.runs} == {
        f"{scene}/{parameters}/seed-{seed}" for scene in "ab" for parameters in ("fine", "coarse") for seed in (1, 2, 3)
    }
    run = next(run for run in batch.runs if run.name == "b/coarse/seed-2")
    assert run.settings == {"log": f"{tmp_path}/logs/b.txt", "every": "5", "seed": "2"}
    assert run.values == run.settings | {"weights": None}
    command = next(j.command for j in make_jobs(batch, tmp_path / "o") if j.name == run.name)
    assert command[3:5] == ("run", f"{tmp_path}/tiny.toml") and f"log={tmp_path}/logs/b.txt" in command


def test_accepted_outcomes_reach_every_scene_and_decide_what_has_run(tmp_path: Path) -> None:
    batch = batch_of(tmp_path, {"a": "write"}, head='accept = ["empty", "unsettled"]')
    plain, job, turned = (
        make_jobs(replace(batch, spec=batch.spec.model_copy(update={"accept": accept})), tmp_path / "o")[0]
        for accept in ((), batch.spec.accept, ("unsettled", "empty"))
    )
    assert job.command == (*plain.command, "--accept", "empty", "--accept", "unsettled")
    assert turned.fingerprint == job.fingerprint != plain.fingerprint


def documented_batches() -> list[dict[str, Any]]:
    """The batch files of the page; blocks that begin with the name of another file are none."""
    text = (Path(__file__).resolve().parents[3] / "docs" / "BATCH.md").read_text()
    blocks = [part.split("```")[0] for part in text.split("```toml\n")[1:]]
    return [tomllib.loads(block) for block in blocks if not block.startswith("# ")]


def test_batch_files_of_the_docs_are_read() -> None:
    """Each block by itself, or, where it is a part, added to the first."""
    blocks = documented_batches()
    assert len(blocks) >= 3
    for block in blocks:
        check_spec(blocks[0] | block, "BATCH.md")


def test_without_parameters_and_seeds_a_scene_is_its_own_folder(tmp_path: Path) -> None:
    batch = batch_of(tmp_path, {"a": "write"})
    assert [run.name for run in batch.runs] == ["a"]
    assert make_jobs(batch, tmp_path / "o")[0].folder == f"{tmp_path}/o/a"


def test_values_are_passed_on_as_they_are(tmp_path: Path) -> None:
    """No shell, no interpolation: blanks, quotes, dollars and letters beyond ASCII survive."""
    odd = "a b$(c)'\"ü;*"
    (tmp_path / odd).mkdir()
    (tmp_path / odd / "x.txt").write_text("write")
    (tmp_path / "list.txt").write_text(f"# a comment\n\n{odd}/x.txt\n")
    path = write_batch(tmp_path, {"a": "write"}, '[set]\nweights = "$HOME --seed 3"')
    path.write_text(path.read_text().replace('glob = "logs/*.txt"', 'list = "list.txt"'))
    batch = read_batch(path)
    assert [run.scene for run in batch.runs] == ["x"]
    words = make_jobs(batch, tmp_path / "o")[0].command
    assert f"log={tmp_path}/{odd}/x.txt" in words and "weights=$HOME --seed 3" in words


def test_a_folder_with_wildcards_in_its_name_is_taken_literally(tmp_path: Path) -> None:
    batch = batch_of(tmp_path / "data[1]*", {"a": "write"})
    assert [run.scene for run in batch.runs] == ["a"]


def test_folders_and_named_scenes_together(tmp_path: Path) -> None:
    path = write_batch(tmp_path, {"a": "write"}, '[[scene]]\nname = "own"\nset = { log = "logs/a.txt", every = 2 }')
    (tmp_path / "rooms" / "one").mkdir(parents=True)
    path.write_text(path.read_text().replace('glob = "logs/*.txt"', 'folders = ["rooms/one", "rooms"]'))
    batch = read_batch(path)
    assert [(run.scene, run.values["every"]) for run in batch.runs] == [("own", "2"), ("one", "1"), ("rooms", "1")]
    assert batch.runs[0].values["log"] == f"{tmp_path}/logs/a.txt", "relative to the batch file"


@pytest.mark.parametrize(
    ("head", "text", "match"),
    [
        ("", "[set]\nnonsense = 1", "set: pipeline tiny has no variable 'nonsense'"),
        ("", '[[parameters]]\nname = "x"\nset = { nonsense = 1 }', "parameters 'x'.*'nonsense'"),
        ("", '[[parameters]]\nname = "x"\n[[parameters]]\nname = "X"', "parameters 'X': not a unique"),
        ("", '[[parameters]]\nname = "sequence"', "'sequence': not a unique"),
        ("seeds = [1]", '[[parameters]]\nname = "seed-1"', "'seed-1': not a unique"),
        ("", '[[parameters]]\nname = "../x"', "not a unique"),
        ("", '[[parameters]]\nname = "x"\nset = { log = "y" }', "'log' is set by data and by parameters 'x'"),
        ("seeds = [1, 2, 1]", "", "seeds: one is there twice"),
        ("seeds = [-1]", "", "seeds"),
        ('seeds = "5-1"', "", "ends before it begins"),
        ('seeds = [1]\nseed_variable = "room"', "", "no variable 'room'"),
        ("seeds = [1]", '[[parameters]]\nname = "x"\nset = { seed = 4 }', "'seed' is set by parameters 'x'"),
        ("", '[limits]\ntime = "soon"', "limits.time: 'soon' is not a number"),
        ("", "[limits]\ntime = 20", "limits.time"),
        ("", '[limits]\nmemory = "4"', "limits.memory"),
        ("", "[limits]\nstop_after_failures = 0", "stop_after_failures"),
        ("", '[executor]\nkind = "cloud"', "executor"),
        ("", '[executor]\nkind = "local"\ncpus = 2', "executor.local.cpus"),
        ("", '[executor]\nkind = "slurm"\nsetup = ["a\\nb"]', "line break"),
        ("", '[[scene]]\nname = "a"\nset = { log = "logs/a.txt" }', "scene 'a': not a unique"),
        ("", '[[scene]]\nname = "s"\nset = { log = "nowhere" }', "scene 's': log = .*nowhere: no such file"),
        ("", "[set]\nevery = true", "set.every: give a text or a number"),
        ("nonsense = 1", "", "nonsense"),
        ("= 1", "", "TOML"),
    ],
)
def test_wrong_batches_are_refused(tmp_path: Path, head: str, text: str, match: str) -> None:
    path = write_batch(tmp_path, {"a": "write"}, text, head)
    with pytest.raises(UsageError, match=match) as caught:
        read_batch(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ('glob = "nowhere/*.txt"', "no match"),
        ('folders = ["logs", "nowhere"]', "nowhere: no such folder"),
        ('folders = ["logs/a.txt"]', "no such folder"),
        ('folders = ["logs", "./logs"]', "named twice"),
        ('list = "nowhere.txt"', "nowhere.txt"),
        ('list = "empty.txt"', "names nothing"),
        ('list = "missing.txt"', "gone.txt: no such file"),
        ('list = "twice.txt"\nglob = "logs/*.txt"', "named twice"),
        ("", "no folders, glob or list"),
    ],
)
def test_wrong_data_sets_are_refused(tmp_path: Path, line: str, match: str) -> None:
    path = write_batch(tmp_path, {"a": "write"})
    (tmp_path / "empty.txt").write_text("\n# nothing\n")
    (tmp_path / "missing.txt").write_text("logs/a.txt\ngone.txt\n")
    (tmp_path / "twice.txt").write_text("logs/../logs/a.txt\n")
    path.write_text(path.read_text().replace('glob = "logs/*.txt"', line))
    with pytest.raises(UsageError, match=match):
        read_batch(path)


def test_the_order_is_shuffled_and_reproducible(tmp_path: Path) -> None:
    batch = batch_of(tmp_path, {f"s{k}": "write" for k in range(20)})
    names = [run.name for run in shuffled(batch.runs, 0)]
    assert names == [run.name for run in shuffled(batch.runs[::-1], 0)]
    assert sorted(names) == sorted(run.name for run in batch.runs) and names != sorted(names)
    assert names != [run.name for run in shuffled(batch.runs, 1)]
    fewer = [run.name for run in shuffled(batch.runs[3:], 0)]
    assert fewer == [name for name in names if name in set(fewer)], "more scenes do not change the order of the others"


def test_the_fingerprint_follows_values_pipeline_and_inputs(tmp_path: Path) -> None:
    def prints(**options: str) -> dict[str, str]:
        batch = batch_of(tmp_path, {"a": "write", "b": "write"}, **options)
        return {job.name: job.fingerprint for job in make_jobs(batch, tmp_path / "o")}

    first = prints()
    assert first["a"] != first["b"]
    os.utime(tmp_path / "logs" / "a.txt", ns=(1, 1))
    os.utime(tmp_path / "logs" / "b.txt", ns=(1, 1))

    def again(**options: str) -> dict[str, str]:
        path = write_batch(tmp_path, {}, **options)
        return {job.name: job.fingerprint for job in make_jobs(read_batch(path), tmp_path / "o")}

    before = again()
    assert before["a"] != first["a"], "the log was touched"
    assert again() == before == again(text="[limits]\ntime = '5 s'"), "limits do not decide a result"
    assert again(text="[set]\nevery = 1") == before, "a default that is spelled out changes nothing"
    assert again(text="[set]\nevery = 2")["a"] != before["a"]
    os.utime(tmp_path / "logs" / "a.txt", ns=(2, 2))
    after = again()
    assert after["a"] != before["a"] and after["b"] == before["b"]


def test_a_name_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = write_batch(tmp_path, {"a": "write"})
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/logs/\xff.txt")).write_text("write")
    with pytest.raises(UsageError, match="not a printable name") as caught:
        read_batch(path)
    str(caught.value).encode()


def test_a_bottomless_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_text("a = " + "[" * 100_000)
    with pytest.raises(UsageError, match="deep.toml"):
        read_batch(tmp_path / "deep.toml")


KEYS = ("pipeline", "set", "scene", "data", "parameters", "seeds", "shuffle_seed", "limits", "executor", "time", "kind")
VALUES = st.recursive(
    st.sampled_from(["ray", "local", "slurm", "4 GiB", "1-3", "log", "", "x\0y"])
    | st.integers(-2, 9)
    | st.booleans()
    | st.floats()
    | st.datetimes(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from((*KEYS, "name", "variable", "glob", "memory", "jobs", "address")), inner, max_size=4
        )
    ),
    max_leaves=12,
)


@given(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=8))
def test_any_values_are_a_batch_or_a_usage_error(values: dict) -> None:
    try:
        check_spec({"pipeline": "reconstruct"} | values, "b.toml")
    except UsageError as error:
        assert str(error).startswith("b.toml: ")


def test_the_examples_of_the_documentation_are_valid() -> None:
    blocks = [block for block in documented_batches() if "executor" in block]
    specs = [check_spec({"pipeline": "reconstruct"} | block, "docs") for block in blocks]
    assert [spec.executor.kind for spec in specs] == ["local", "ray", "slurm"]
    whole = blocks[0]
    assert set(whole) == set(BatchSpec.model_fields), "the example shows every key"
    for key, model in (("data", DataSpec), ("limits", Limits)):
        assert set(whole[key]) == set(model.model_fields)
    for block, options in zip(blocks, (LocalOptions, RayOptions, SlurmOptions), strict=True):
        assert set(options.model_fields) - set(block["executor"]) <= {"jobs"}, "and every option"
