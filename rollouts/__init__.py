"""Many episodes: experts that solve tasks, playing them, recording them."""
