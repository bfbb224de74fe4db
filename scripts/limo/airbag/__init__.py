"""The same bricks on a square airbag, a case with published answers."""
