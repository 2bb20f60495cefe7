"""The terms of a planning step's program: what a plan optimises and what it must keep, one module each."""
