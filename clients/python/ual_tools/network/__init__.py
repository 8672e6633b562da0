"""The UAVs of many computers: what `ual --network` finds, lists, watches and passes to a gateway (docs/network.md)."""
