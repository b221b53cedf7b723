"""`python -m scenewright`: the command line without an installed console script."""

import sys
from importlib.util import find_spec

if find_spec("typer") is None or find_spec("pydantic") is None:
    sys.stderr.write(
        f"error: {sys.executable}: this Python has not what scenewright needs "
        "(make setup; then .venv/bin/scenewright, or . .venv/bin/activate)\n"
    )
    raise SystemExit(5)

from scenewright.cli.main import main  # noqa: E402

main()
