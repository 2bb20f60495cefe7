"""The quadratic program in stages, what a point of it is worth, and what a solver must offer."""
