"""Whether this installation can do its work, and what to do where it cannot."""

from wholebody.doctor.examination import Entry, Report, examine

__all__ = ["Entry", "Report", "examine"]
