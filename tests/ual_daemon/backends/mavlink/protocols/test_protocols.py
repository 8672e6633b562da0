"""All protocols of a link: those that have nothing to do are not asked at each step of a flight."""

from concurrent.futures import Future
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.firmwares.mission_items import MissionType
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.mavlink.wire.frames import MessageSource

ALWAYS = {"gimbals", "cameras"}
"""These ask for what may be there."""


def names_of_waiting(protocols: Protocols) -> set[str]:
    return {name for name, each in vars(protocols).items() if each in protocols._all and each.is_waiting}


def attached() -> tuple[Protocols, list[Any]]:
    sent: list[Any] = []
    protocols = Protocols(sent.append, lambda _: True)
    protocols.attach(MessageSource(1, 1), Px4())
    protocols.tick(1.0)
    return protocols, sent


def test_only_those_are_ticked_that_have_something_to_do() -> None:
    protocols, _ = attached()
    assert names_of_waiting(protocols) == ALWAYS
    protocols.parameters.read("X", Future())
    protocols.missions.download(MissionType.FENCE, Future())
    protocols.component_metadata.request(Future())
    protocols.logs.list(Future())
    protocols.corrections.give(b"x")
    begun = {"parameters", "missions", "component_metadata", "logs", "corrections"}
    protocols.tick(1.1)
    assert names_of_waiting(protocols) == ALWAYS | begun
    protocols.parameters.on_value(mavlink.MAVLink_param_value_message(b"X", 1.0, 9, 1, 0), 1.2)
    protocols.drop("the autopilot has booted")
    protocols.tick(1.3)
    assert not names_of_waiting(protocols) & {"parameters", "missions"}


def test_what_is_requested_by_the_end_of_another_exchange_is_sent() -> None:
    protocols, sent = attached()
    read: Future[Any] = Future()
    listed: Future[Any] = Future()
    listed.add_done_callback(lambda _: protocols.parameters.read("Y", read))
    protocols.parameters.read_all(listed)
    for step in range(10_000):
        protocols.tick(2.0 + 0.1 * step)  # no answer comes: the list ends, and then the read
        if read.done():
            break
    assert listed.exception() is not None
    assert read.exception() is not None
    assert sent[-1].get_type() == "PARAM_REQUEST_READ"
