"""Address at which a client flies: the same UAV again, never another one of its name."""

from __future__ import annotations

import pytest

from tests.ual.network.samples import report, source, uav
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.network import computer
from ual.network.followed import Followed, best_address
from ual.network.keys import Source
from ual.network.roster import Roster
from ual.network.values import NetworkUav, Report


class Case:
    """A UAV that is followed over a roster."""

    def __init__(self) -> None:
        self.roster = Roster(lambda _, __: None)
        self.followed = Followed("uav_1", self.roster.called, "site farm")

    def tell(self, instance: int, address: str, host: str = "a", started_s: float = 1.0) -> None:
        by = source(instance=instance)
        self.roster.on_alive(by, 0.0)
        self.roster.on_report(by, report(uav(address=address), host=host, started_s=started_s), 1.0)


@pytest.fixture
def case() -> Case:
    return Case()


def test_a_uav_that_is_not_there_is_reported(case: Case) -> None:
    with pytest.raises(DaemonUnreachableError, match="no UAV uav_1 is on the network \\(site farm\\)"):
        case.followed.address()


def test_it_is_found_again_where_its_daemon_was_started_again(case: Case) -> None:
    case.tell(1, "10.0.0.1:50051")
    assert case.followed.address() == "10.0.0.1:50051"
    case.roster.on_gone(source(instance=1), 2.0)
    assert case.followed.address() == "10.0.0.1:50051"
    case.tell(2, "10.0.0.1:50099")
    assert case.followed.address() == "10.0.0.1:50099"


def test_of_two_with_its_name_none_is_chosen(case: Case) -> None:
    case.tell(1, "10.0.0.1:50051", "a")
    case.tell(2, "10.0.0.2:50051", "b")
    with pytest.raises(InvalidArgumentError, match=r"2 UAVs have the name uav_1: .*10.0.0.1.* and .*10.0.0.2"):
        case.followed.address()


def test_what_flies_one_goes_on_when_another_takes_its_name(case: Case) -> None:
    case.tell(1, "10.0.0.1:50051", "a")
    assert case.followed.address() == "10.0.0.1:50051"
    case.tell(2, "10.0.0.2:50051", "b")
    assert case.followed.address() == "10.0.0.1:50051"


def test_another_computers_uav_of_its_name_is_not_executed_instead(case: Case) -> None:
    case.tell(1, "10.0.0.1:50051", "a")
    assert case.followed.address() == "10.0.0.1:50051"
    case.roster.on_gone(source(instance=1), 2.0)
    case.tell(2, "10.0.0.2:50051", "b")
    with pytest.raises(InvalidArgumentError, match="uav_1 was on a and is now told by b: that is another UAV"):
        case.followed.address()


def listening_at(*addresses: str, computer_id: str) -> NetworkUav:
    told = report(host="a", computer_id=computer_id)
    one = Report(told.teller, (uav(),))
    by: Source = source()
    return NetworkUav(
        "uav_1",
        by.site,
        by.publisher,
        by.instance,
        type(uav())("uav_1", one.uavs[0].telemetry, addresses=addresses),
        told.teller,
        0.0,
    )


def test_the_best_address_is_one_that_is_reached_from_here() -> None:
    addresses = ("10.0.0.1:50051", "127.0.0.1:50051", "unix:/run/uav_1.sock")
    assert best_address(listening_at(*addresses, computer_id="another")) == "10.0.0.1:50051"
    assert best_address(listening_at(*addresses, computer_id=computer.identifier())) == "127.0.0.1:50051"


def test_a_uav_that_listens_only_on_its_own_computer_says_so() -> None:
    with pytest.raises(
        DaemonUnreachableError, match=r"only on its own computer, a .*--listen, or fly it through a gateway"
    ):
        best_address(listening_at("127.0.0.1:50051", computer_id="another"))
