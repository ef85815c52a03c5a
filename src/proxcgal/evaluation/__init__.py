"""What happened in a run: ground truth, visibility, termination, metrics."""
