"""Experts of the cells of `tasks.cells`: short scripts of the same few moves."""
