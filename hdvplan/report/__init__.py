"""Results as tables, pictures, maps and files: values in, objects or bytes out."""

PICTURES = ("png", "pdf", "svg")
DRAWINGS = ("dxf", "gpkg")  # for CAD and GIS
TURN_DRAWINGS = ("dxf",)  # of what lies nowhere on a map
