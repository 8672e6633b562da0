"""The contract, generated from ``proto/ual/v1`` by ``make proto``. `ual._convert` reads and writes its messages."""
