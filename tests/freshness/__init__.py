"""The key of an artifact has to change when the code that made it changes meaning. `Stage.version` is raised by hand;
here every step's code is remembered beside it, so that nobody can forget.

`program.py` reads the code, `records.py` keeps one file a step in `steps/`, `test_records.py` compares, `record.py` is
the command, `same_bytes.py` its evidence by runs of `runs.py`.
"""
