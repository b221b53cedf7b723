"""`python -m benchmarks`."""

import os
import sys

from benchmarks.command import main

if __name__ == "__main__":
    os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the default probes TBB first, warns about its version
    sys.exit(main())
