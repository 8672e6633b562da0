"""Reads YAML files strictly: each value by its kind, each error with its line."""
