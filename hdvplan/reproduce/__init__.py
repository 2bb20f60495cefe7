"""The published experiments again: each study's numbers beside the published ones, its figure and its data."""

# By the names that users give them, the quick ones first: the modules, whose functions have these names, and seconds on one slow core.
STUDIES = {
    "bus-uturn": ("bus", 2.0),
    "roundabout": ("roundabout", 3.0),
    "overhang": ("bus", 2.0),
    "standards": ("standards", 12.0),
    "objectives": ("objectives", 10.0),
    "s-turns": ("s_turns", 7.0),
    "timing": ("timing", 130.0),
}
