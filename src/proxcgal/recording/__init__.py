"""Recordings: written, read, replayed, rendered."""
