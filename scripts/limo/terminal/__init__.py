"""The command `limo`."""
