"""The front door: a table of commands, console output, exit codes; no logic."""
