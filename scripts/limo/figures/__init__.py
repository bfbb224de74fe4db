"""One module a figure, and the drawing tools they share.

A module of a figure has ``draw(dataset, measured)``, which returns a matplotlib figure.

A figure in ``SHAPES`` shows surfaces; its ``draw(dataset, measured, shapes)`` takes the study's shapes too.
"""
