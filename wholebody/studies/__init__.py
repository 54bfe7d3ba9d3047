"""One task many times: many problems at once, studies of people, targets and layouts, reach maps."""
