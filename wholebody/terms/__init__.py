"""Goals, constraints and measures as arrays: residuals, compiled evaluation, linearisation, checked derivatives."""
