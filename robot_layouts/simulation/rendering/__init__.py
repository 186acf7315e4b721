"""What is only needed to draw: cameras, visuals, pictures, the graphics device."""
