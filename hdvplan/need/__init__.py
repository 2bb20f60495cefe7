"""The least room that a vehicle needs on a road, and what must change where it does not fit."""
