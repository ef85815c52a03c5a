"""Static scenes with random draws."""
