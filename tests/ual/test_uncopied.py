"""Clients are neither copied nor pickled."""

from __future__ import annotations

import asyncio
import copy
import pickle
from collections.abc import Callable
from typing import Any

import pytest

import ual
import ual.aio

WAYS: list[Callable[[Any], object]] = [copy.copy, copy.deepcopy, pickle.dumps]


@pytest.mark.parametrize("way", WAYS)
def test_a_client_is_not_copied(way: Callable[[Any], object]) -> None:
    """A copy closed its original; pickle refused a lock that nobody knows."""
    with (
        ual.Uav(address="127.0.0.1:1") as uav,
        ual.Team(["127.0.0.1:1"]) as team,
    ):
        for each in (uav, team):
            with pytest.raises(TypeError, match="cannot be copied or pickled: make another one"):
                way(each)


@pytest.mark.parametrize("way", WAYS)
def test_a_client_of_asyncio_is_not_copied(way: Callable[[Any], object]) -> None:
    async def run() -> None:
        async with ual.aio.Uav(address="127.0.0.1:1") as uav:
            with pytest.raises(TypeError, match=r"ual.aio.Uav .* cannot be copied or pickled"):
                way(uav)

    asyncio.run(run())


def test_a_closed_client_and_another_loop_have_a_reason_of_their_own() -> None:
    """They were INTERNAL: "a defect of the daemon"."""
    uav = ual.Uav(address="127.0.0.1:1")
    uav.close()
    with pytest.raises(ual.ClientUnusableError, match="this client is closed") as refused:
        uav.info()
    assert refused.value.reason == "CLIENT_UNUSABLE"
    twin = ual.aio.Uav(address="127.0.0.1:1")

    async def ask() -> None:
        await twin.info()

    with pytest.raises(ual.DaemonUnreachableError):
        asyncio.run(ask())
    with pytest.raises(ual.ClientUnusableError, match="another event loop"):
        asyncio.run(ask())
