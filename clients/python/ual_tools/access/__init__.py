"""Output of `ual token` and `ual certificates`: private files, and the certificates of a team."""
