"""Attack the package with random hard cases, and judge every answer by coal and Pinocchio alone."""
