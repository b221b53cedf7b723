"""How a robot acts in a room that it believes in: for every system that plans, sees or moves (docs/ARCHITECTURE.md)."""
