"""The calls of the services beside that of the UAV; see `ual._calls`. ``make proto`` writes all but `by_hand`."""
