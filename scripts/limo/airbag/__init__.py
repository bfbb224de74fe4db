"""The same model on a square airbag, a case with published answers."""
