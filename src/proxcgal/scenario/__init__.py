"""Scenario files: keys, loading, and the set-up of what runs."""
