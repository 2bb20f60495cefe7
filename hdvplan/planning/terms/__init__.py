"""The terms of a planning step's program: what a plan wants and what it must keep, one module each."""
