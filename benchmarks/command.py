"""`python -m benchmarks NAME`: the one command line of all experiments. Without a name it lists them."""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from scenewright.schemas.errors import ScenewrightError, UsageError

from benchmarks.discovery import experiment_files, load_experiment, summary_of
from benchmarks.experiment import Bench, Experiment, Results, Trial, shown
from benchmarks.gather import gather
from benchmarks.keeping import measure_missing, read_record, wanted_trials
from benchmarks.options import add_option
from benchmarks.results import write_results

CHECKOUT = Path(__file__).resolve().parents[1]
PUBLISHED = CHECKOUT / "docs" / "results"
CODE = ("stages", "schemas", "cli", "benchmarks")
"""Folders that have to be as they are in a commit when figures are published."""
UNMET = 4
"""Exit code when an expectation does not hold."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run an experiment; return the exit code (docs/ARCHITECTURE.md)."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words or words[0] in ("-h", "--help"):
        print("python -m benchmarks NAME --out FOLDER [options]; NAME --help lists them")
        print("python -m benchmarks gather FOLDER: one table and one metrics.json of the experiments below it\n")
        for name, file in experiment_files().items():
            print(f"  {name:18} {summary_of(file)}")
        return 0
    try:
        if words[0] == "gather" and len(words) == len(("gather", "FOLDER")):
            print(gather(Path(words[1])))
            return 0
        return run(load_experiment(words[0]), words)
    except KeyboardInterrupt:
        print("stopped; what is measured is kept", file=sys.stderr)
        return 130
    except ScenewrightError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code


def run(experiment: Experiment, words: Sequence[str]) -> int:
    """Measure what is missing and write the results. `words`: the command line, the experiment's name first."""
    options = parser_of(experiment).parse_args(words[1:])
    bench = bench_of(experiment, vars(options))
    trials = wanted_trials(
        experiment, bench, arms=options.arms, cases=options.cases, seeds=options.seeds, most=options.count
    )
    if options.publish:
        check_that_may_be_published(bench, kept=options.kept)
    code = 0
    if not options.kept:
        jobs = options.jobs or experiment.jobs
        code = measure_missing(experiment, bench, trials, jobs=jobs, fresh=options.fresh or not experiment.keeps)
    found = {trial: read_record(experiment, bench, trial, any_code=options.kept) for trial in trials}
    records = {trial: record for trial, record in found.items() if record is not None}
    if not records:
        print(f"{experiment.name}: nothing is measured", file=sys.stderr)
        return code
    results = Results(experiment, bench, shown(experiment, records))
    missing = [trial for trial in trials if trial not in records]
    print(write_results(results, _as_recorded(words, options, experiment.places), missing))
    if options.publish:
        print(f"{publish(results, missing, kept=options.kept)}: `make figures` shows it", file=sys.stderr)
    problems = experiment.problems(results) if experiment.problems else ()
    for problem in problems:
        print(f"expectation not met: {problem}", file=sys.stderr)
    return code or (UNMET if problems else 0)


def _as_recorded(words: Sequence[str], options: argparse.Namespace, places: Collection[str] = ()) -> tuple[str, ...]:
    """Return the command line that stands beside figures: where they were written, and what lay where, says nothing."""
    folders = {str(options.out), *(str(getattr(options, name)) for name in places)}
    kept = ["FOLDER" if word in folders else word for word in words if word != "--publish"]
    return ("python", "-m", "benchmarks", *kept)


def changed_code(checkout: Path = CHECKOUT) -> list[str]:
    """Return what of the code in a checkout is in no commit. Raises UsageError where there is no git."""
    words = ["git", "-C", str(checkout), "status", "--porcelain", "--", *CODE]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UsageError(f"nothing is published: {checkout} is no git checkout", hint="figures name their commit")
    return done.stdout.splitlines()


def check_that_may_be_published(bench: Bench, *, kept: bool, missing: Sequence[Trial] = ()) -> None:
    """Raises UsageError for figures of tuning seeds, of a quick or unfinished run, of records of any code (`kept`), and
    where the code is in no commit."""
    whys = {
        "this is no run over reporting seeds": bench.quick or bench.tuning,
        "--kept takes records of any code": kept,
        f"{len(missing)} trials are missing": bool(missing),
    }
    for why, holds in whys.items():
        if holds:
            raise UsageError(f"nothing is published: {why}", hint="run it without --quick, --tuning, --kept to its end")
    if changed := changed_code():
        raise UsageError(f"nothing is published: in no commit: {', '.join(changed[:3])}", hint="commit, and run again")


def publish(results: Results, missing: Sequence[Trial], *, kept: bool, folder: Path | None = None) -> Path:
    """Copy figures.json whole to where pages take it from, so that nothing written there by hand stays, and return that
    file. Raises UsageError as `check_that_may_be_published`."""
    check_that_may_be_published(results.bench, kept=kept, missing=missing)
    file = (folder or PUBLISHED) / f"{results.experiment.name}.json"
    file.write_bytes((results.bench.out / "figures.json").read_bytes())
    return file


def bench_of(experiment: Experiment, options: Mapping[str, Any]) -> Bench:
    """Return the bench of the options, which hold the experiment's own where they are given. Raises SystemExit(2) for
    a value out of range."""
    own = {name: options[name] for name in experiment.parameters.model_fields if options.get(name) is not None}
    quick = bool(options.get("quick"))
    try:
        parameters = experiment.parameters.model_validate({**(experiment.quick if quick else {}), **own})
    except ValidationError as error:
        first = error.errors()[0]
        print(f"error: --{str(first['loc'][0]).replace('_', '-')}: {first['msg']}", file=sys.stderr)
        raise SystemExit(2) from None
    return Bench(Path(options["out"]), parameters, quick, bool(options.get("tuning")))


def parser_of(experiment: Experiment) -> argparse.ArgumentParser:
    """Return the parser: options of every experiment, and those of its parameters."""
    described = f"{experiment.title}. Simulated: {experiment.simulated} Does not show: {experiment.does_not_show}"
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks {experiment.name}", description=described)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="fewer seeds, smaller trials")
    parser.add_argument("--tuning", action="store_true", help="the tuning seeds instead of those for reporting")
    parser.add_argument("--arms", nargs="+", default=[], metavar="ARM", help=", ".join(experiment.arms))
    parser.add_argument("--cases", nargs="+", default=[], metavar="CASE", help=", ".join(experiment.cases))
    parser.add_argument("--seeds", nargs="+", default=[], metavar="SEED", help="only these")
    parser.add_argument("--count", type=int, help="only so many seeds of every case, in their order")
    parser.add_argument("--jobs", type=int, help=f"measure so many at a time (default: {experiment.jobs})")
    parser.add_argument("--fresh", action="store_true", help="measure again what is kept")
    parser.add_argument("--kept", action="store_true", help="measure nothing: tabulate what is kept, of any code")
    parser.add_argument("--publish", action="store_true", help="copy figures.json to docs/results, for `make figures`")
    for name, field in experiment.parameters.model_fields.items():
        add_option(parser, name, field)
    return parser
