"""hdvplan: can this bus or truck drive this real road, how evenly does it sweep it, and which QP solver plans it fast enough?"""

__version__ = "0.1.0"
