"""The version of the program, which all results name."""

__version__ = "0.1.0"
