"""``ual view``: the UAVs in a page of the browser. docs/view.md describes it; docs/decisions/0035 says why it is so."""
