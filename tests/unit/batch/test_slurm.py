"""Scripts of a job array: sound shell, whole parts, results joined once. No cluster is asked."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.errors import UsageError
from scenewright.stages.engine.batch.results import ResultsFile, read_results
from scenewright.stages.engine.batch.slurm_executor import (
    merge_parts,
    parse_task,
    part_of,
    part_path,
    read_job_list,
    task_count,
    write_scripts,
)
from scenewright.stages.engine.batch.spec import SlurmOptions

from tests.unit.batch.batches import job, result


@given(st.integers(1, 3000), st.integers(1, 50), st.integers(1, 1000))
def test_every_job_is_in_exactly_one_part(scenes: int, each: int, largest: int) -> None:
    options = SlurmOptions(kind="slurm", scenes_per_task=each, largest_array=largest)
    count, names = task_count(scenes, options), [str(k) for k in range(scenes)]
    parts = [part_of(names, index, count) for index in range(count)]
    assert count <= largest and all(parts) and sorted(n for p in parts for n in p) == sorted(names)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_scripts_are_sound_shell_and_say_what_was_asked(tmp_path: Path) -> None:
    out = tmp_path / "a b'$(x)%j"
    options = SlurmOptions(
        kind="slurm", jobs=8, scenes_per_task=3, cpus=2, directives=("--partition=short",), setup=("module load x",)
    )
    jobs = [job(f"s{k}", time_limit=600.0, memory_limit=2**32) for k in range(10)]
    scripts = write_scripts(tmp_path / "spec.toml", out, jobs, options, ["--retry", "all"])
    assert (scripts.tasks, scripts.scenes) == (4, 10) and read_job_list(out) == [j.name for j in jobs]
    for path in (scripts.array, scripts.collect, scripts.submit):
        subprocess.run(["bash", "-n", path], check=True)
    text = scripts.array.read_text()
    for line in ("--array=0-3%8", "--partition=short", "--cpus-per-task=2", "--mem=4608M", "--time=33"):
        assert f"#SBATCH {line}\n" in text, line
    assert f'#SBATCH --output="{tmp_path}/a b\'$(x)%%j/slurm/task-%a.log"\n' in text
    assert '--task "${SLURM_ARRAY_TASK_ID}/4" --retry all' in text and text.index("module load") < text.index("exec")
    assert "--collect" in scripts.collect.read_text()


def test_the_command_line_in_the_script_is_quoted(tmp_path: Path) -> None:
    out = tmp_path / "a b'$(touch x)"
    scripts = write_scripts(tmp_path / "spec.toml", out, [job("a")], SlurmOptions(kind="slurm"))
    line = next(line for line in scripts.array.read_text().splitlines() if line.startswith("exec "))
    shown = subprocess.run(
        ["bash", "-c", line.replace("exec ", "printf '%s\\n' ", 1)],
        env={"SLURM_ARRAY_TASK_ID": "0"},
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    assert shown.stdout.splitlines()[3:] == ["batch", f"{tmp_path}/spec.toml", "--out", str(out), "--task", "0/1"]
    assert not (tmp_path / "x").exists()


def test_wrong_tasks(tmp_path: Path) -> None:
    assert parse_task("3/20") == (3, 20)
    for text in ("3", "20/20", "-1/3", "a/b", "1/2/3", ""):
        with pytest.raises(UsageError, match="INDEX/COUNT"):
            parse_task(text)
    with pytest.raises(UsageError, match="without --task"):
        read_job_list(tmp_path)


def test_parts_are_joined_once_even_after_a_kill_in_between(tmp_path: Path) -> None:
    (tmp_path / "slurm").mkdir()
    early, late = result("a", "crash", started="2026-01-01T00:00:00"), result("a", started="2026-01-02T00:00:00")
    part_path(tmp_path, 0).write_bytes(late.as_line() + result("b").as_line()[:20])
    part_path(tmp_path, 1).write_bytes(early.as_line())
    path = tmp_path / "results.jsonl"
    path.write_bytes(early.as_line())  # a collection was killed after its first line
    with ResultsFile(path) as results:
        assert merge_parts(tmp_path, results) == 1
        assert merge_parts(tmp_path, results) == 0
    assert read_results(path) == [early, late]
    assert list((tmp_path / "slurm").iterdir()) == []
