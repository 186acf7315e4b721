"""Reads URDFs and meshes that may come from anyone, and guesses a descriptor from them."""
