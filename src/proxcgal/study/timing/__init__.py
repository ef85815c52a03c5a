"""The timing grid."""
