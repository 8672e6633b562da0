"""Manoeuvres: one a module."""
