"""The methods and tools that are set beside each other: one file a tool, which solves and follows a reach by steps."""
