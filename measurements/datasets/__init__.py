"""What datasets cost: recording, opening, certifying; and a large one, made from end to end."""
