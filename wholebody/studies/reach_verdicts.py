"""Codes of what is known of a place of a reach map."""

NOT_TRIED, REACHED, MISSED, EXCLUDED, BEYOND, INSIDE = range(6)
VERDICTS = ("not tried", "reached", "missed", "excluded", "beyond", "inside")
"""Words of the codes of a verdict."""
