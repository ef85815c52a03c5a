"""Runs of one scenario: results folder, figures, pictures."""
