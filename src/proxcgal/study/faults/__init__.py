"""The study of injected faults."""
