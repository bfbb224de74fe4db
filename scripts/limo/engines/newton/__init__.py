"""Engine newton: a model is carried from equilibrium to equilibrium by shifted Newton iterations."""
