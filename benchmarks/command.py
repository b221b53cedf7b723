"""`python -m benchmarks NAME`: the one command line of all experiments. Without a name it lists them."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from scenewright.schemas.errors import ScenewrightError, UsageError

from benchmarks.discovery import experiment_files, load_experiment, summary_of
from benchmarks.experiment import Bench, Experiment, Results, Trial, shown
from benchmarks.gather import gather
from benchmarks.keeping import measure_missing, read_record, wanted_trials
from benchmarks.options import add_option
from benchmarks.reporting_seeds import FILE, UNRECORDED, newest, note_use
from benchmarks.results import write_results

PUBLISHED = Path(__file__).resolve().parents[1] / "docs" / "results"
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
    code, met = 0, seeds_met(experiment, bench, trials, kept=options.kept)
    if not options.kept:
        jobs = options.jobs or experiment.jobs
        code = measure_missing(experiment, bench, trials, jobs=jobs, fresh=options.fresh or not experiment.keeps)
    found = {trial: read_record(experiment, bench, trial, any_code=options.kept) for trial in trials}
    records = {trial: record for trial, record in found.items() if record is not None}
    if not records:
        print(f"{experiment.name}: nothing is measured", file=sys.stderr)
        return code
    results = Results(experiment, bench, shown(experiment, records), met)
    missing = [trial for trial in trials if trial not in records]
    print(write_results(results, _as_recorded(words, options), missing))
    if options.publish:
        print(f"{publish(results, missing, options.kept)}: `make figures` shows it", file=sys.stderr)
    problems = experiment.problems(results) if experiment.problems else ()
    for problem in problems:
        print(f"expectation not met: {problem}", file=sys.stderr)
    return code or (UNMET if problems else 0)


def _as_recorded(words: Sequence[str], options: argparse.Namespace) -> tuple[str, ...]:
    """Return the command line that stands beside figures: where they were written says nothing."""
    kept = ["FOLDER" if word == str(options.out) else word for word in words if word not in ("--publish", "--kept")]
    return ("python", "-m", "benchmarks", *kept)


def publish(results: Results, missing: Sequence[Trial], kept: bool, folder: Path = PUBLISHED) -> Path:
    """Copy figures.json to where pages take it from, and return that file. Of what is `kept` parts may be missing,
    which the file, and the head of its page, then name. Raises UsageError for figures of tuning seeds or of a quick
    run, and for another unfinished one."""
    if results.bench.quick or results.bench.tuning or (missing and not kept):
        what = f"{len(missing)} trials are missing" if missing else "this is no run over reporting seeds"
        raise UsageError(f"nothing is published: {what}", hint="run it without --quick and --tuning to its end")
    file = folder / f"{results.experiment.name}.json"
    made = json.loads((results.bench.out / "figures.json").read_text())
    if missing:
        counts = Counter(f"{trial.arm}/{trial.case}" for trial in missing)
        made["not_measured"] = {name: counts[name] for name in sorted(counts)}
    file.write_text(json.dumps(made, indent=1, sort_keys=True) + "\n")
    return file


def seeds_met(
    experiment: Experiment, bench: Bench, trials: Sequence[Trial], *, kept: bool, file: Path = FILE
) -> dict[str, str]:
    """Return which set of reporting seeds is measured and by which digest of the method, and record that it is, before
    anything can be seen; nothing where the experiment's seeds are in no set, or others are measured. What is `kept` was
    recorded when it was measured: the set's newest digest is told."""
    if not experiment.seed_group or experiment.method is None or bench.quick or bench.tuning:
        return {}
    found = newest(experiment.seed_group, file)
    if not any(experiment.cluster(trial.seed) in found.seeds for trial in trials):
        return {}
    if kept:
        digests = [met.method for met in found.met if met.experiment == experiment.name]
        digest = digests[-1] if digests else UNRECORDED
    else:
        digest = experiment.method.digest()
        found = note_use(found.name, experiment.name, digest, file)
    if found.kind == "tuning":
        print(f"{experiment.name}: {found.name} has met another method: tuning seeds from now on", file=sys.stderr)
    return {"set": found.name, "kind": found.kind, "method": digest, "first_used": str(found.first_used)}


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
