"""One trial: simulated, interactive, or a walk-through."""
