"""`python -m cli`: the command line without an installed console script."""

from cli.main import main

main()
