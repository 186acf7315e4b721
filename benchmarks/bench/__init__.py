"""Benchmarks: what steps, resets, workers, recordings and checks cost, beside the physics alone."""
