"""Guards of quality: small seeded cases whose figures must not get worse than a limit. They are slow, `make test-all`.

No time is measured here; everything is seeded. Limits leave room for other machines, whose last bits differ: a count of
discrete outcomes may be one or two off where a case lies close to its threshold, a mean or a share as much as a handful
of such cases moves it.

When one fails, the small case is worse for a reason that the benchmark of that part (docs/results) shows as well. Never
loosen a limit to pass; tighten it when figures have got better for good.
"""
