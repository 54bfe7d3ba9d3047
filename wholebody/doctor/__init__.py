"""Checks of an installation, with repairs for every fault."""

from wholebody.doctor.examination import Entry, Report, examine

__all__ = ["Entry", "Report", "examine"]
