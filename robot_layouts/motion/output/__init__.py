"""Motions as files, tables, pictures and pages."""
