"""What things are made of: materials, masses, inertia."""
