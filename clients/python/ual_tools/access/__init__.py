"""What `ual token` and `ual certificates` make: private files, and the certificates of a team."""
