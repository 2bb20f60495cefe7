"""The published experiments again: each study's numbers beside the published ones, its figure and its data."""

# By the names that users give them, the quick ones first: the modules, whose functions have these names, and shares of all time.
STUDIES = {
    "bus-uturn": ("bus", 0.01),
    "roundabout": ("roundabout", 0.02),
    "overhang": ("bus", 0.01),
    "standards": ("standards", 0.01),
    "objectives": ("objectives", 0.17),
    "s-turns": ("s_turns", 0.15),
    "timing": ("timing", 0.63),
}
