"""The commands that users call."""
