"""The networks that clients of this process name: each is joined with its first client, and left with its last."""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ual import _forks
from ual.errors import InvalidArgumentError
from ual.network import settings
from ual.network.session import forked, require
from ual.network.settings import NetworkSettings

if TYPE_CHECKING:
    from ual.network.followed import Followed
    from ual.network.listening import Network

_log = logging.getLogger(__name__)

_POLL_PERIOD_S = 0.05


def follow(network: Network | NetworkSettings | str | Path, ns: str) -> Followed | Member:
    """Returns what says where a UAV of a network is, at any time; the only one, where `ns` is empty.

    Raises:
        InvalidArgumentError: It is no network, or its settings are not valid.
        NotSupportedError: The extra ``network`` is not installed.

    """
    if isinstance(network, (NetworkSettings, str, Path)):
        return Member(network, ns)
    if not hasattr(network, "follow"):
        raise InvalidArgumentError(
            f"network: {network!r:.60} is none; pass a ual.network.Network, its settings, or their file",
            {"field": "network"},
        )
    return network.follow(ns)


def joined() -> int:
    """Returns how many networks clients of this process use by name."""
    return len(_memberships.by_settings)


class _Attempt:
    """One attempt to join, on a thread of its own: an event loop must not wait for it."""

    def __init__(self, config: NetworkSettings) -> None:
        self._config = config
        self.network: Network | None = None
        self.failure: Exception | None = None
        self.thread = threading.Thread(target=self._join, name="ual network")
        self.thread.start()

    @property
    def has_ended(self) -> bool:
        return self.network is not None or self.failure is not None

    def _join(self) -> None:
        from ual.network.listening import Network

        try:
            self.network = Network(self._config, on_problem=_note)
        except Exception as error:  # noqa: BLE001  it is the caller's, who waits on another thread
            self.failure = error


class _Membership:
    """One network, and how many clients use it."""

    def __init__(self, config: NetworkSettings) -> None:
        self._config = config
        self.client_count = 0
        self.attempt: _Attempt | None = None

    def begin(self) -> _Attempt:
        """Returns the attempt that runs or has succeeded; a new one, where the last one failed."""
        if self.attempt is None or self.attempt.failure is not None:
            self.attempt = _Attempt(self._config)
        return self.attempt


class _Memberships:
    """Memberships of this process."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.by_settings: dict[NetworkSettings, _Membership] = {}
        _forks.renew_in_child(self)

    def begin_anew(self) -> None:
        """Ends the attempts of the parent in a forked process: the threads that make them are not here."""
        self.lock = threading.Lock()
        for each in self.by_settings.values():
            if each.attempt is not None and not each.attempt.has_ended:
                each.attempt.failure = forked()

    def enter(self, config: NetworkSettings) -> _Membership:
        with self.lock:
            found = self.by_settings.setdefault(config, _Membership(config))
            found.client_count += 1
            return found

    def leave(self, config: NetworkSettings) -> None:
        with self.lock:
            left = self.by_settings[config]
            left.client_count -= 1
            if left.client_count:
                return
            del self.by_settings[config]
        if left.attempt is not None:
            left.attempt.thread.join()
            if left.attempt.network is not None:
                left.attempt.network.close()


_memberships = _Memberships()


class Member:
    """One client's part in a network that it names: where its UAV is."""

    def __init__(self, config: NetworkSettings | str | Path, ns: str) -> None:
        require("the network", "ual-client[network]")
        self._config = settings.read(config)
        self._ns = ns
        self._attempt: _Attempt | None = None
        self._followed: Followed | None = None
        self._is_closed = False
        self._membership = _memberships.enter(self._config)

    @property
    def ns(self) -> str:
        """Its name; where none was given, that of the only one, once `address` was requested."""
        return self._ns if self._followed is None else self._followed.ns

    @property
    def is_settled(self) -> bool:
        """Whether the address can be requested: the network is joined and heard, or cannot be joined."""
        if self._followed is not None:
            return self._followed.is_settled
        if self._attempt is None:
            with _memberships.lock:
                self._attempt = self._membership.begin()
        if self._attempt.network is None:
            return self._attempt.failure is not None
        self._followed = self._attempt.network.follow(self._ns)
        return self._followed.is_settled

    def address(self) -> str:
        """Returns where the UAV is now. After a network that could not be joined, it is tried again."""
        while not self.is_settled:
            time.sleep(_POLL_PERIOD_S)
        if self._followed is None:
            failed, self._attempt = self._attempt, None
            assert failed is not None
            assert failed.failure is not None
            raise failed.failure
        return self._followed.address()

    def close(self) -> None:
        """Leaves the network, with the last of its clients."""
        if not self._is_closed:
            self._is_closed = True
            _memberships.leave(self._config)


def _note(problem: str) -> None:
    _log.warning("network: %s", problem)
