"""What every room stands on: errors, arrays, checks of arguments, files, compilation, processes."""
