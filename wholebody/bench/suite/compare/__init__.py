"""Speed against accuracy: every method on every problem set at many budgets, judged alike, charted and explained."""
