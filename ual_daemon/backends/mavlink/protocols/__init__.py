"""MAVLink's protocols besides flying, as state machines without threads, sockets or clocks."""
