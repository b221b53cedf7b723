"""What has been measured is kept, trial by trial, under a key: who asks again gets it, whatever was killed between.

`<out>/trials/<arm>/<case>/<seed>/record.json` holds the key and the record; the trial's other files lie beside it. The
key covers experiment, trial, parameters, the content of the inputs, and the code that the arm runs.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import sys
import time
import traceback
from collections.abc import Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from pydantic import TypeAdapter
from scenewright.schemas.base import canonical_json
from scenewright.schemas.errors import BadInput, ScenewrightError, UsageError
from scenewright.stages.engine.code.digests import code_of, step_code
from scenewright.stages.engine.discovery import stage_by_name
from scenewright.stages.engine.reading import read_manifest
from scenewright.stages.kit.digests import external_digest, sha256_of_text

from benchmarks.discovery import load_experiment
from benchmarks.experiment import Bench, Experiment, Trial

RECORD = "record.json"
PACKAGE = "benchmarks"
"""Followed beside scenewright where the code of a trial is read."""


def key_of(experiment: Experiment, bench: Bench, trial: Trial) -> str:
    """Return the key under which a trial is kept. Raises BadInput when an input is not there."""
    parameters = bench.parameters.model_dump(mode="json")
    inputs = experiment.inputs(bench, trial) if experiment.inputs else ()
    facts = {
        "experiment": experiment.name,
        "trial": [trial.arm, trial.case, trial.seed],
        "parameters": {name: value for name, value in parameters.items() if name not in experiment.places},
        "inputs": [_digest_of(path) for path in inputs],
        "code": _code_of(experiment, trial.arm),
    }
    return sha256_of_text(canonical_json(facts))


_DIGESTS: dict[tuple[Path, int], str] = {}


def _digest_of(path: Path) -> str:
    if (path / "manifest.json").is_file():
        return read_manifest(path).content_digest
    stamp = (path, path.stat().st_mtime_ns if path.exists() else 0)
    if stamp not in _DIGESTS:
        _DIGESTS[stamp] = external_digest(path)
    return _DIGESTS[stamp]


def _code_of(experiment: Experiment, arm: str) -> list[str]:
    """The digests of the experiment's steps, and of its own modules for the arm, or else of its measuring function."""
    module, name = experiment.measure.__module__, experiment.measure.__name__
    roots = [f"{other}:" for other in experiment.code.get(arm, ())] or [f"{module}:{name}"]
    return [code_of(*roots, also=(PACKAGE,)).digest, *(step_code(stage_by_name(s)).digest for s in experiment.steps)]


def read_record(experiment: Experiment, bench: Bench, trial: Trial, *, any_code: bool = False) -> Any | None:
    """Return the kept record of a trial; None when there is none of this key (of any key with `any_code`)."""
    try:
        kept = json.loads((bench.folder(trial) / RECORD).read_text(encoding="utf-8"))
        if not any_code and kept["key"] != key_of(experiment, bench, trial):
            return None
        return TypeAdapter(experiment.record).validate_python(kept["record"])
    except (FileNotFoundError, json.JSONDecodeError, KeyError):
        return None


def kept_records(name: str, out: Path) -> dict[Trial, Any]:
    """Return every record that lies below the output folder of an experiment, whatever code it was measured with.
    Raises BadInput when there is none."""
    adapter, found = TypeAdapter(load_experiment(name).record), {}
    for path in sorted((out / "trials").rglob(RECORD)):
        arm, *case, seed = map(unquote, path.relative_to(out / "trials").parent.parts)
        found[Trial(arm, "/".join(case), seed)] = adapter.validate_json(
            json.dumps(json.loads(path.read_bytes())["record"])
        )
    if not found:
        raise BadInput(f"{out}: no trial of {name}", hint=f"python -m benchmarks {name} --out {out} measures")
    return found


def keep_record(experiment: Experiment, bench: Bench, trial: Trial, key: str, record: Any, seconds: float) -> None:
    """Write a trial's record under a key; it appears whole."""
    path = bench.folder(trial) / RECORD
    path.parent.mkdir(parents=True, exist_ok=True)
    values = TypeAdapter(experiment.record).dump_python(record, mode="json")
    kept = {"key": key, "seconds": round(seconds, 3), "record": values}
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(kept) + "\n", encoding="utf-8")
    partial.replace(path)


def measure_missing(
    experiment: Experiment,
    bench: Bench,
    trials: Sequence[Trial],
    *,
    jobs: int = 1,
    fresh: bool = False,
    any_code: bool = False,
) -> int:
    """Measure the trials that are not kept, in groups that share work; return the worst exit code, 0 when all is well.

    A group that fails is told on standard error and leaves the others alone.
    """
    missing = [trial for trial in trials if fresh or read_record(experiment, bench, trial, any_code=any_code) is None]
    _say(f"{experiment.name}: {len(trials) - len(missing)} trials kept, {len(missing)} to measure")
    if not missing:
        return 0
    if experiment.prepare:
        experiment.prepare(bench, missing)
    groups: dict[Hashable, dict[Trial, str]] = {}
    for trial in missing:  # keys before anything runs: code that is edited meanwhile is not what was measured with
        groups.setdefault(experiment.together(trial), {})[trial] = key_of(experiment, bench, trial)
    if jobs == 1:
        return max(measure_group(experiment.name, bench, group) for group in groups.values())
    threads = str(max(1, (os.cpu_count() or 1) // jobs))
    os.environ.update({"NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads})
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = [pool.submit(measure_group, experiment.name, bench, group) for group in groups.values()]
        return max(future.result() for future in waiting)


def measure_group(name: str, bench: Bench, keys: Mapping[Trial, str]) -> int:
    """Measure trials that share work and keep each as soon as it is there; return the exit code."""
    experiment, trials = load_experiment(name), list(keys)
    for trial in trials:
        shutil.rmtree(bench.folder(trial), ignore_errors=True)
    started = time.perf_counter()
    try:
        for trial, record in experiment.measure(bench, trials):
            now = time.perf_counter()
            keep_record(experiment, bench, trial, keys[trial], record, now - started)
            _say(f"{trial}: {now - started:.1f} s")
            started = now
    except ScenewrightError as error:
        _say(f"{trials[0]} (of {len(trials)} together): error: {error}")
        return error.exit_code
    except Exception:
        traceback.print_exc()
        _say(f"{trials[0]} (of {len(trials)} together): failed, see above")
        return 1
    return 0


def wanted_trials(
    experiment: Experiment,
    bench: Bench,
    *,
    arms: Sequence[str] = (),
    cases: Sequence[str] = (),
    seeds: Sequence[str] = (),
    most: int | None = None,
) -> list[Trial]:
    """Return arms x cases x seeds, cut down to what is asked for. Raises UsageError for a name that is none of them."""
    chosen_cases = cases or (experiment.default_cases(bench) if experiment.default_cases else experiment.cases)
    chosen_arms = arms or (experiment.default_arms(bench) if experiment.default_arms else list(experiment.arms))
    for given, known, what in ((arms, list(experiment.arms), "arm"), (cases, experiment.cases, "case")):
        for name in given:
            if name not in known:
                raise UsageError(f"no {what} {name!r} in {experiment.name}", hint=f"there are {', '.join(known)}")
    trials = list(_crossed(experiment, bench, chosen_arms, chosen_cases, seeds, most))
    for name in set(seeds) - {trial.seed for trial in trials}:
        raise UsageError(f"no seed {name!r} in {experiment.name}, {', '.join(chosen_cases)}", hint="see --tuning")
    return trials


def _crossed(
    experiment: Experiment,
    bench: Bench,
    arms: Sequence[str],
    cases: Sequence[str],
    seeds: Sequence[str],
    most: int | None,
) -> Iterator[Trial]:
    for case in cases:
        known = list(experiment.seeds_of(bench, case) if experiment.seeds_of else _declared(experiment, bench))
        if not known:
            _say(f"{experiment.name}: no seed of the case {case} is there, it is left out")
        cut = most or (experiment.quick_seeds if bench.quick else None)
        for seed in [s for s in known if s in seeds] if seeds else known[:cut]:
            yield from (Trial(arm, case, seed) for arm in arms if experiment.runs(arm, case))


def _declared(experiment: Experiment, bench: Bench) -> Sequence[str]:
    return experiment.tuning if bench.tuning else experiment.reporting


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
