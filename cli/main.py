"""Entry point: builds the command table and turns every error into one line and an exit code."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
INTERRUPTED = 130
INTERRUPTED_TEXT = "interrupted; every finished artifact is as it was"


def _refuse_foreign_packages() -> None:
    """`stages` and `schemas` are common names: refuse to run when they come from somewhere else."""
    import schemas
    import stages

    for package in (schemas, stages):
        found = Path(package.__file__ or "").resolve().parent.parent
        if found != REPOSITORY:
            sys.stderr.write(
                f"error: package {package.__name__!r} comes from {found}, not from {REPOSITORY} "
                "(run from another folder, or clear PYTHONPATH)\n"
            )
            raise SystemExit(5)


def _set_up_logging(level: int) -> None:
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    logger = logging.getLogger("scenewright")
    logger.handlers[:] = [handler]
    logger.setLevel(level)
    logger.propagate = False


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code."""
    import typer
    from typer.exceptions import TyperException

    from schemas.errors import ScenewrightError
    from stages.engine import interruption

    debug = "--debug" in arguments
    _set_up_logging(logging.WARNING if "--quiet" in arguments else logging.DEBUG if debug else logging.INFO)
    try:
        from cli.application import build_application

        with interruption.heard():
            result = build_application()(args=arguments, prog_name="scenewright", standalone_mode=False)
        if result == INTERRUPTED:  # typer's own translation of KeyboardInterrupt
            _say_error(INTERRUPTED_TEXT)
        return result if isinstance(result, int) else 0
    except ScenewrightError as error:
        if debug:
            raise
        _say_error(str(error))
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        _say_error(INTERRUPTED_TEXT)
        return INTERRUPTED
    except TyperException as error:
        context = getattr(error, "ctx", None)
        where = f"{context.command_path}: " if context is not None else ""
        message = error.format_message() if hasattr(error, "format_message") else str(error)
        _say_error(f"{where}{message} (see --help)")
        return 2
    except BrokenPipeError:
        return _reader_left()
    except ImportError as error:
        if debug:
            raise
        _say_error(f"{error} (run: scenewright doctor)")
        return 5
    except Exception as error:
        if debug:
            raise
        _say_error(f"internal error: {type(error).__name__}: {error} (a bug of ours; --debug shows where)")
        return 1


def _say_error(text: str) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stderr.write("error: " + " ".join(text.split()) + "\n")


def _reader_left() -> int:
    """Nobody reads our output any more (`| head`): an interruption, and the exit must not stumble over it again."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nothing, stream.fileno())
    return INTERRUPTED


def _keep_standard_output_for_data() -> None:
    """Send what native libraries print to file descriptor 1 (pybullet greets there) to standard error instead."""
    sys.stdout.flush()
    data = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = data


def main() -> None:
    """Run the command line of this process."""
    _refuse_foreign_packages()
    from stages.engine import interruption

    try:
        interruption.install()
        interruption.end_with_parent()
        _keep_standard_output_for_data()
        os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the default probes TBB first, warns about its version
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # idle threads sleep: spinning halves the rate when busy
        code = run(sys.argv[1:])
        interruption.ignore()
        sys.stdout.flush()
    except KeyboardInterrupt:  # before `run` could catch it, or a second one while it did
        interruption.ignore()
        _say_error(INTERRUPTED_TEXT)
        code = INTERRUPTED
    except BrokenPipeError:
        code = _reader_left()
    if code == INTERRUPTED:
        # Python ends by SIGINT, not by our code, when the exception once passed through an `exec` (dataclasses use it).
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
