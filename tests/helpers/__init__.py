"""What several test files use: small models, written cases, curves, the page of results."""
