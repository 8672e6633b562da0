"""What `ual record` and `ual plot` do with recordings: write what a client sees, and read, draw and export it."""
