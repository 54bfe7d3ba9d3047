"""The method placo: the tasks of placo's KinematicsSolver, iterated until a problem is solved."""
