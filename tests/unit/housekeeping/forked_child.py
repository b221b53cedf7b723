"""Says whether a library was loaded before it began, works for a moment, and ends with 3."""

import sys
import time

loaded = "colorsys" in sys.modules
time.sleep(float(sys.argv[1]))
print(loaded)
sys.exit(3)
