"""What results depend on the processor, by playing the same episodes as on others."""
