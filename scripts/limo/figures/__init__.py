"""One module a figure. A module has ``draw(dataset, measured)``, which returns a matplotlib figure."""

#: figures a study may name
FIGURES = ("pressure_volume", "strain_life")
#: figures that need an output of their study beyond volumes
NEEDS = {"strain_life": "fatigue"}
