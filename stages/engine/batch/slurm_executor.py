"""A batch as a Slurm job array: scripts that are written out, and what their tasks and the collection do.

Nothing is submitted from here. A task of the array runs its part of the job list on its node with local processes and
writes its own results file; the collection joins these files into results.jsonl.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import MachineFailure, UsageError
from scenewright.schemas.outside import file_text
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.results import RESULTS_NAME, ResultsFile, read_results
from scenewright.stages.engine.batch.spec import SlurmOptions
from scenewright.stages.engine.own_code import own_code

FOLDER_NAME = "slurm"
LIST_NAME = "jobs.txt"
OWN_MEMORY = 512 * 2**20
"""What the batch itself may take beside a scene [bytes]."""
OWN_SECONDS = 120
"""What a task may take beside its scenes [s]."""


@dataclass(frozen=True)
class Scripts:
    """What was written."""

    array: Path
    collect: Path
    submit: Path
    tasks: int
    scenes: int


def task_count(scenes: int, options: SlurmOptions) -> int:
    """Return the number of array tasks for so many scenes."""
    return min(math.ceil(scenes / options.scenes_per_task), options.largest_array)


def part_of(names: Sequence[str], index: int, count: int) -> list[str]:
    """Return the names that task `index` of `count` runs: every count-th, so that parts differ by one at most."""
    return list(names[index::count])


LARGEST_LIST = 64 * 2**20
"""Largest list of jobs [bytes]."""


def parse_task(text: str) -> tuple[int, int]:
    """Return index and count of `3/20`. Raises UsageError."""
    index, _, count = text.partition("/")
    if not (index.isdecimal() and count.isdecimal() and int(index) < int(count)):
        raise UsageError(f"--task {text!r}: not INDEX/COUNT", hint="for example --task 0/20")
    return int(index), int(count)


def part_path(out: Path, index: int) -> Path:
    """Return the results file of a task."""
    return out / FOLDER_NAME / f"results-{index}.jsonl"


def read_job_list(out: Path) -> list[str]:
    """Return the names of the jobs that the scripts were written for. Raises UsageError."""
    path = out / FOLDER_NAME / LIST_NAME
    return file_text(path, LARGEST_LIST, error=UsageError, hint="run the batch without --task first").splitlines()


def _directive(name: str, value: str) -> str:
    """An #SBATCH line; % begins a placeholder of Slurm's, and a value with blanks has to be quoted."""
    return f'#SBATCH --{name}="{value}"' if any(letter in value for letter in " \t") else f"#SBATCH --{name}={value}"


def _array_directives(folder: Path, jobs: Sequence[Job], options: SlurmOptions, tasks: int) -> list[str]:
    throttle = f"%{options.jobs}" if options.jobs else ""
    log = str(folder).replace("%", "%%")
    lines = [
        _directive("job-name", "scenewright-batch"),
        _directive("array", f"0-{tasks - 1}{throttle}"),
        _directive("cpus-per-task", str(options.cpus)),
        _directive("output", f"{log}/task-%a.log"),
    ]
    limit = jobs[0].time_limit
    if limit is not None:
        each = math.ceil(len(jobs) / tasks)
        lines.append(_directive("time", str(math.ceil((each * (limit + jobs[0].grace) + OWN_SECONDS) / 60))))
    memory = jobs[0].memory_limit
    if memory is not None:
        lines.append(_directive("mem", f"{math.ceil((memory + OWN_MEMORY) / 2**20)}M"))
    return [*lines, *(f"#SBATCH {words}" for words in options.directives)]


def _script(directives: Sequence[str], options: SlurmOptions, command: str) -> str:
    lines = [
        "#!/bin/bash",
        *directives,
        "set -eu",
        *options.setup,
        f"cd {shlex.quote(os.getcwd())}",
        *(f"export {name}={shlex.quote(value)}" for name, value in own_code().items()),
        command,
    ]
    return "\n".join(lines) + "\n"


def write_scripts(
    spec_path: Path, out: Path, jobs: Sequence[Job], options: SlurmOptions, extra: Sequence[str] = ()
) -> Scripts:
    """Write the job list and the scripts of an array of at least one job into `out`/slurm; `extra` words go to every
    task. Raises MachineFailure when the folder cannot be written."""
    folder, tasks = out / FOLDER_NAME, task_count(len(jobs), options)
    words = [sys.executable, "-m", "scenewright", "batch", str(spec_path), "--out", str(out)]
    base = shlex.join(words)
    extra_words = "".join(f" {shlex.quote(word)}" for word in extra)
    array = _script(
        _array_directives(folder, jobs, options, tasks),
        options,
        f'exec {base} --task "${{SLURM_ARRAY_TASK_ID}}/{tasks}"{extra_words}',
    )
    log = str(folder).replace("%", "%%")
    collect = _script(
        [
            _directive("job-name", "scenewright-collect"),
            _directive("output", f"{log}/collect.log"),
            *(f"#SBATCH {words}" for words in options.directives),
        ],
        options,
        f"exec {base} --collect",
    )
    quoted_folder = shlex.quote(str(folder))
    submit = (
        "#!/bin/bash\nset -eu\n"
        f"array=$(sbatch --parsable {quoted_folder}/array.sh)\n"
        f'sbatch --dependency="afterany:${{array%%;*}}" {quoted_folder}/collect.sh\n'
    )
    texts = {LIST_NAME: "\n".join(job.name for job in jobs) + "\n", "array.sh": array, "collect.sh": collect}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in {**texts, "submit.sh": submit}.items():
            (folder / name).write_text(text, encoding="utf-8")
            if name.endswith(".sh"):
                (folder / name).chmod(0o755)
    except OSError as error:
        raise MachineFailure(f"{folder}: {error.strerror}", hint="choose another --out") from None
    return Scripts(folder / "array.sh", folder / "collect.sh", folder / "submit.sh", tasks, len(jobs))


def merge_parts(out: Path, results: ResultsFile) -> int:
    """Move the results of array tasks into results.jsonl and return how many. The caller holds the batch's lock.

    A part is removed after its lines are on disk; lines that are there already (a kill in between) are not doubled.
    """
    part_files = sorted((out / FOLDER_NAME).glob("results-*.jsonl"))
    if not part_files:
        return 0
    known_lines = {result.as_line() for result in read_results(out / RESULTS_NAME)}
    result_of_line = {result.as_line(): result for part in part_files for result in read_results(part)}
    missing_results = sorted(
        (result_of_line[line] for line in result_of_line.keys() - known_lines),
        key=lambda result: (result.started, result.job),
    )
    for result in missing_results:
        results.append(result)
    for part in part_files:
        part.unlink()
    return len(missing_results)
