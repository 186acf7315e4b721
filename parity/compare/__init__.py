"""Tasks stepped beside native in lock-step, every bit compared."""
