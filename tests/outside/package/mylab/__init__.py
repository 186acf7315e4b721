"""A laboratory's own tasks, as a user of robot-layouts writes them."""
