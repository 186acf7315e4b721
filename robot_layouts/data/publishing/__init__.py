"""Data sets for others: on the Hugging Face Hub, with a card."""
