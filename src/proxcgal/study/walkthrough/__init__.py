"""The study of walk-through programming."""
