"""Reports of the audits, as jinja2 templates."""

from pathlib import Path

TEMPLATES = Path(__file__).parent
