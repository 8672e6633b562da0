"""The parameters of a MAVLink autopilot: what any thread requests goes to the thread that receives."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, UalError
from ual.parameters.values import Description, Parameter
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.parameter_files import packed_list
from ual_daemon.backends.mavlink.offers.files import has_files
from ual_daemon.backends.mavlink.offers.parameter_descriptions import ParameterDescriptions
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.parameter_transfers import ParameterTransfers
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal

T = TypeVar("T")

MOST_LIST_BYTES = 500_000
"""Most bytes of the packed list. ArduPilot's has 20,000."""

_log = logging.getLogger(__name__)


class MavlinkParameters(AutopilotParameters):
    """The parameters of one backend. `access` is the way to the thread that receives."""

    def __init__(self, access: ProtocolAccess) -> None:
        self._access = access
        self._lock = threading.Lock()
        self._descriptions: ParameterDescriptions | None = None

    @property
    @override
    def relied_on(self) -> frozenset[str]:
        session = self._access.session()
        return frozenset() if session is None else session.dialect.relied_on

    @override
    def read(self, name: str) -> Future[Parameter]:
        return self._run_on_loop("read its parameters", lambda transfers, future: transfers.read(name, future))

    @override
    def read_all(self) -> Future[list[Parameter]]:
        session = self._access.session()
        if session is None or not session.dialect.packed_parameters or not has_files(session):
            return self._run_on_loop("read its parameters", ParameterTransfers.read_all)
        return self._read_packed(session.dialect.packed_parameters)

    @override
    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        return self._run_on_loop(
            "write a parameter", lambda transfers, future: transfers.write(parameter, refusal, future)
        )

    @override
    def descriptions(self) -> Future[Mapping[str, Description]]:
        session = self._access.session()
        if session is None:
            return super().descriptions()
        with self._lock:
            known = self._descriptions
            if known is None or known.session is not session or known.is_cut_off:
                self._descriptions = known = ParameterDescriptions(session, self._access.post)
        return known.get()

    def _read_packed(self, path: str) -> Future[list[Parameter]]:
        """Reads the packed list, which takes a fifth of the time; where that fails, the list as it is streamed."""

        def begin(protocols: Protocols, future: Future[list[Parameter]]) -> None:
            data: Future[bytes] = Future()
            data.add_done_callback(lambda ended: self._on_packed(protocols.parameters, ended, future))
            protocols.files.run(data, protocols.files.read_all(path, MOST_LIST_BYTES))

        return self._access.run_on_loop("read its parameters", begin)

    def _on_packed(self, transfers: ParameterTransfers, data: Future[bytes], future: Future[list[Parameter]]) -> None:
        """Takes the packed list, on the thread that receives."""
        try:
            found = packed_list(data.result())
        except LinkLostError as error:
            futures.fail(future, error)
        except (UalError, ValueError) as error:
            _log.info("the packed list of parameters cannot be read, so they are streamed: %s", error)
            transfers.read_all(future)
        else:
            transfers.note_names(frozenset(each.name for each in found))
            if future.set_running_or_notify_cancel():
                future.set_result(found)

    def _run_on_loop(self, what: str, begin: Callable[[ParameterTransfers, Future[T]], None]) -> Future[T]:
        return self._access.run_on_loop(what, lambda protocols, future: begin(protocols.parameters, future))
