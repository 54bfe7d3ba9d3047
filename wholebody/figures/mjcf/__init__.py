"""MJCF files, as MuJoCo compiles them."""
