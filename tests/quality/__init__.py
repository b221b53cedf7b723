"""Guards of quality: small seeded cases whose figures have to stay within tight bands of what they are today.

No time is measured here; everything is seeded. Bands leave room for other machines, whose last bits differ: a count of
discrete outcomes may be one or two off where a case lies close to its threshold, a mean or a share as much as a handful
of such cases moves it. A change of the algorithm that users would notice moves them further (each was tried by making
something worse).

When one fails, look first whether the change was meant. Better figures: set the band around the new ones in the same
commit, whose message says which benchmark says so too. Worse ones: the bands stay; the small case is worse for a reason
that the benchmark of that part (docs/results) will show as well. Never widen a band to pass.
"""
