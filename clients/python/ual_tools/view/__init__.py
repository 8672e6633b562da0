"""``ual view``: the UAVs in a page of the browser. See docs/how-to/view.md and docs/evidence/decisions/0035."""
