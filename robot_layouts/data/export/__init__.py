"""Recorded episodes in the formats that training tools read, and on the Hugging Face Hub."""
