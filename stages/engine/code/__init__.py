"""What a step's code is, as a digest that goes into the key of what the step makes.

`program.py` follows definitions, `places.py` says where modules lie, `digests.py` keeps answers in the user's cache.
"""
