"""Says whether a library was loaded before it began, works for a moment, and ends with 3."""

import sys
import time

print("colorsys" in sys.modules)
time.sleep(float(sys.argv[1]))
sys.exit(3)
