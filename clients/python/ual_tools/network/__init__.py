"""The UAVs of many computers: what `ual --network` finds, lists, watches, gives a gateway (docs/how-to/network.md)."""
