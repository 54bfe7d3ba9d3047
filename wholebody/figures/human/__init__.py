"""The person: its specification from anthropometry, its pieces in three details, and its figure."""
