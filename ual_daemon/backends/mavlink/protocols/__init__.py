"""MAVLink's protocols beside flying, as state machines without threads, sockets or clocks."""
