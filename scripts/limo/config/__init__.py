"""YAML files become a checked project; a mistake becomes one message."""
