"""Entry point: builds the command table and turns every error into one line and an exit code."""

from __future__ import annotations

import logging
import os
import signal
import sys

INTERRUPTED_TEXT = "interrupted; every finished artifact is as it was"


class _Lines(logging.Formatter):
    """Messages on one line each, cleaned of what they name; the columns of a table's line stay where they are."""

    def format(self, record: logging.LogRecord) -> str:
        from scenewright.schemas.plain_text import LONGEST_LINE, cleaned, one_line

        text = super().format(record)
        if record.exc_info is not None:
            return text
        return cleaned(text) if len(text) <= LONGEST_LINE and len(text.splitlines()) == 1 else one_line(text)


def _set_up_logging(level: int) -> None:
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Lines("%(message)s"))
    logger = logging.getLogger("scenewright")
    logger.handlers[:] = [handler]
    logger.setLevel(level)
    logger.propagate = False


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code."""
    from scenewright.stages.engine import interruption

    with interruption.waiting():  # numpy, for one, makes an import error of an interruption
        import typer
        from scenewright.cli.output import say_error
        from scenewright.cli.streams import INTERRUPTED, ReaderLeft
        from scenewright.schemas.errors import MachineFailure, ScenewrightError
        from scenewright.stages.engine.machine_faults import is_machines
        from scenewright.stages.engine.runner import NO_CODE_CACHE, NO_CODE_CACHE_HINT, NO_CODE_CACHE_TEXT
        from typer.exceptions import TyperException

    debug = "--debug" in arguments
    _set_up_logging(logging.WARNING if "--quiet" in arguments else logging.DEBUG if debug else logging.INFO)
    try:
        from scenewright.cli.application import build_application

        with interruption.heard():
            result = build_application()(args=arguments, prog_name="scenewright", standalone_mode=False)
        if result == INTERRUPTED:  # typer's own translation of KeyboardInterrupt
            say_error(INTERRUPTED_TEXT)
        return result if isinstance(result, int) else 0
    except ReaderLeft as error:
        return error.exit_code
    except ScenewrightError as error:
        if debug:
            raise
        say_error(str(error))
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        say_error(INTERRUPTED_TEXT)
        return INTERRUPTED
    except TyperException as error:
        context = getattr(error, "ctx", None)
        where = f"{context.command_path}: " if context is not None else ""
        message = error.format_message() if hasattr(error, "format_message") else str(error)
        say_error(f"{where}{message} (see --help)")
        return 2
    except ImportError as error:
        if debug:
            raise
        say_error(f"{error} (run: scenewright doctor)")
        return 5
    except (OSError, MemoryError) as error:  # inputs and outputs have their own words where they are opened
        if debug:
            raise
        if not is_machines(error, arguments):
            return _say_bug(error)
        path, reason = getattr(error, "filename", None), getattr(error, "strerror", None)
        say_error(f"{f'{path}: ' if path else ''}{reason or str(error) or 'out of memory'} (the machine failed)")
        return MachineFailure.exit_code
    except Exception as error:
        if debug:
            raise
        if NO_CODE_CACHE in str(error):
            say_error(f"{NO_CODE_CACHE_TEXT} ({NO_CODE_CACHE_HINT})")
            return MachineFailure.exit_code
        return _say_bug(error)


def _say_bug(error: Exception) -> int:
    from scenewright.cli.output import say_error

    say_error(f"internal error: {type(error).__name__}: {error} (a bug of ours; --debug shows where)")
    return 1


def _leave_lost_folder() -> OSError | None:
    """Return why the current folder cannot be, once out of it: libraries do not even load there (Python 3.13)."""
    try:
        os.getcwd()
    except OSError as error:
        os.chdir(os.sep)
        return error
    return None


def _check_surroundings(lost: OSError | None = None) -> None:
    """Raise MachineFailure where no command can work: in a folder that is gone."""
    from scenewright.schemas.errors import MachineFailure

    try:
        if lost is not None:
            raise lost
        os.getcwd()
    except OSError as error:
        raise MachineFailure(f"the current folder: {error.strerror}", hint="go to one that is there") from None


def main() -> None:
    """Run the command line of this process."""
    try:
        _run_and_exit()
    except KeyboardInterrupt:  # while the first modules load, before any signal handler of ours stands
        if sys.stderr is not None:
            sys.stderr.write(f"error: {INTERRUPTED_TEXT}\n")
            sys.stderr.flush()
        os._exit(128 + signal.SIGINT)


def _run_and_exit() -> None:
    lost = _leave_lost_folder()
    from scenewright.cli import streams
    from scenewright.cli.output import say_error
    from scenewright.schemas.errors import ScenewrightError
    from scenewright.stages.engine import interruption

    streams.set_up()
    try:
        interruption.install()
        interruption.end_with_parent()
        _check_surroundings(lost)
        os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the default probes TBB first, warns about its version
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # idle threads sleep: spinning halves the rate when busy
        code = run(sys.argv[1:])
        interruption.ignore()
        sys.stdout.flush()
    except KeyboardInterrupt:  # before `run` could catch it, or a second one while it did
        interruption.ignore()
        say_error(INTERRUPTED_TEXT)
        code = streams.INTERRUPTED
    except streams.ReaderLeft as error:
        code = error.exit_code
    except ScenewrightError as error:
        say_error(str(error))
        code = error.exit_code
    if code == streams.INTERRUPTED:
        # Python ends by SIGINT, not by our code, when the exception once passed through an `exec` (dataclasses use it).
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
