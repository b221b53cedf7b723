"""The thread: its centre line in both eyes, matched along the curve, as a curve in space that says how sure it is."""
