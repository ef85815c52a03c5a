"""Scenarios, the simulated world, one run and its durable log."""
