"""The contract, generated from ``proto/ual/v1`` by ``make proto``. `ual.wire` reads and writes its messages."""
