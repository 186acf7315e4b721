"""From a start and goals to a motion: goal configurations, paths, when who moves."""
