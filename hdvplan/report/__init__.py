"""Results as tables, pictures, maps and files: values in, objects or bytes out."""

PICTURES = ("png", "pdf", "svg")
DRAWINGS = ("dxf", "gpkg")  # for CAD and GIS
TURN_DRAWINGS = ("dxf",)  # of what lies nowhere on a map

# Colours of pictures and maps, which colour-blind readers can distinguish, also in print:
BODY_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#8C564B")  # Okabe and Ito's, and a brown; they repeat
BREACH = "#C40023"  # never alone: broken limits are thick, marked or written out as well
INK, MUTED, FAINT = "#1F1F1F", "#6B6B6B", "#E6E6E6"
BAND = "0.75"  # with the driver's error


def body_colour(unit: int) -> str:
    """Return the colour of body number ``unit``; colours repeat in long chains."""
    return BODY_COLOURS[unit % len(BODY_COLOURS)]


def answer_colour(*, fits: bool | None) -> str:
    """Return the colour that an answer is written in; its first word says as much."""
    return BREACH if fits is False else INK
