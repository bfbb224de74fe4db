"""One module a figure. A module has ``draw(dataset, measured)``, which returns a matplotlib figure."""

#: figures a study may name
FIGURES = ("pressure_volume",)
