"""The end of a daemon amid an exchange: nothing is left open on the autopilot for which another one would wait."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from tests.simulators.mission_store import MISSION, Px4Store
from tests.ual_daemon.backends.mavlink.test_autopilot_cut_uploads import SILENT, begins
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import wait_for_position
from ual.errors import LinkLostError
from ual.types import State

CONTENT = random.Random(7).randbytes(3_000_000)


@pytest.fixture
def flight(kind: str) -> Iterator[Flight]:
    flight = Flight(kind)
    files = flight.autopilot.files
    files.files[f"{files.directory}/00000001.BIN"] = CONTENT
    flight.wait_for_state(State.LANDED_DISARMED)
    yield flight
    flight.uav.close()


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_log_that_is_downloaded_is_closed(flight: Flight) -> None:
    [log] = flight.uav.logs.get_all()
    chunks = flight.uav.logs.download(log.id)
    next(chunks)
    assert flight.autopilot.files.is_open
    flight.uav.close()
    flight.autopilot.run(2.0)  # ArduPilot first sends the burst that is under way
    assert not flight.autopilot.files.is_open


@pytest.mark.parametrize("kind", ["px4"])  # ArduPilot takes no word of it, and another station's upload at any time
def test_an_upload_is_withdrawn(flight: Flight) -> None:
    wait_for_position(flight)
    store, begun = flight.autopilot.missions, list[int]()
    assert isinstance(store, Px4Store)

    def on_taken(of: int, taken: int) -> None:
        if (of, taken) == (MISSION, 5):
            flight.link.down = SILENT
            begun.append(taken)

    store.on_taken = on_taken
    ended = begins(flight)()
    flight.wait_for(lambda: bool(begun), "the upload")
    flight.uav.close()
    flight.autopilot.run(0.1)
    with pytest.raises(LinkLostError, match="the daemon ends"):
        ended.result(0)
    assert store.lists[MISSION] == []
    assert store.is_idle
