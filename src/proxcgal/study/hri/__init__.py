"""The human study."""
