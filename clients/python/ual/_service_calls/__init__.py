"""The calls of the services besides that of the UAV; see `ual._calls`. ``make proto`` writes all but `by_hand`."""
