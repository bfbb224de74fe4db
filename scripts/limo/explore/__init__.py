"""From ranges of a design to designs that can be recommended: samples, surrogates, sensitivities, a search."""
