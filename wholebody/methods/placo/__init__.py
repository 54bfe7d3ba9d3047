"""The method placo: placo's KinematicsSolver, iterated until a problem is solved."""
