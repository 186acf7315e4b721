"""What cameras see, drawn by SAPIEN."""
