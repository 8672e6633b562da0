"""Forks the workers of pytest-xdist off one process that has collected the tests. Each would take 8 to 13 s of the
processor to import and collect the same.

A worker is a child of the controller's process, as one that was started.
"""

from __future__ import annotations

import importlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any, NoReturn
from unittest import mock

import pytest
from _pytest import config as of_pytest
from _pytest.tmpdir import TempPathFactory
from execnet import gateway_io
from execnet.gateway_base import ExecModel, Popen2IO
from execnet.xspec import XSpec

from tests import forkserver

_BOOT = "import sys; exec(eval(sys.stdin.readline()))"
"""Code by which execnet begins a worker."""


def fork_workers(config: pytest.Config, specs: list[XSpec]) -> None:
    """Lets xdist start its workers by forks. With --cov, each is traced from its start."""
    if sys.platform != "linux" or config.getoption("cov_source", None) or not all(each.popen for each in specs):
        return
    mother = _Mother(config.invocation_params.args)
    patch = mock.patch.object(gateway_io, "create_io", mother.start_worker)
    patch.start()
    config.add_cleanup(mother.close)
    config.add_cleanup(patch.stop)


class _Mother:
    """The process that collects the tests, seen from the controller."""

    def __init__(self, arguments: Any) -> None:
        self._connection, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            collects = f"{__name__}.collect({list(map(str, arguments))}, {its.fileno()})"
            self._process = subprocess.Popen(
                [sys.executable, "-c", f"import sys; sys.path = {sys.path}; import {__name__}; {collects}"],
                pass_fds=[its.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )

    def start_worker(self, _: XSpec, execmodel: ExecModel) -> _WorkerIO:
        stdin, to_worker = os.pipe()
        from_worker, stdout = os.pipe()
        request = forkserver.Request("worker", [], dict(os.environ))
        try:
            pid = forkserver.fork_off(self._connection, request, stdin, stdout, sys.stderr.fileno())
        except (OSError, ValueError) as error:  # it has ended, and has said why: a file that is not there, an option
            raise pytest.UsageError("the tests cannot be collected") from error
        finally:
            os.close(stdin)
            os.close(stdout)
        return _WorkerIO(forkserver.ForkedProcess(pid), to_worker, from_worker, execmodel)

    def close(self) -> None:
        self._connection.close()
        self._process.wait()


class _WorkerIO(Popen2IO):
    """A worker, for execnet."""

    remoteaddress: str

    def __init__(
        self, process: forkserver.ForkedProcess, to_worker: int, from_worker: int, execmodel: ExecModel
    ) -> None:
        super().__init__(os.fdopen(to_worker, "wb"), os.fdopen(from_worker, "rb"), execmodel=execmodel)
        self.wait: Callable[[], int] = process.wait
        self.kill: Callable[[], None] = process.kill


# --- The process that has collected, and the workers that are forked off it -------------------------------------------


def collect(arguments: list[str], connection: int) -> None:
    """Collects tests as pytest does with these arguments, and forks workers for the other end of the connection."""
    pytest.main(arguments, plugins=[_Collected(socket.socket(fileno=connection))])


class _Collected:
    """Serves forks once the tests are collected."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._failed: list[pytest.CollectReport] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_cmdline_main(self, config: pytest.Config) -> None:
        _remote().setup_config(config, None)
        config.workerinput, config.workeroutput = {}, {}  # type: ignore[attr-defined]

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if not report.passed:
            self._failed.append(report)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        _remote().WorkerInteractor.pytest_collection_modifyitems(self, session.config, session.items)
        _capture(session.config).stop_global_capturing()
        assert threading.active_count() == 1, f"a module starts a thread as it is imported: {threading.enumerate()}"
        if forkserver.serve(self._connection):
            _Worker(session, self._failed).run()
        return True


class _Worker:
    """Takes the place of the session that xdist would begin."""

    def __init__(self, session: pytest.Session, failed: Sequence[pytest.CollectReport]) -> None:
        self._session, self._config, self._failed = session, session.config, failed
        self._path, self._has_groups = sys.path, session.config.option.loadgroup
        self._prepare = mock.patch.object(of_pytest, "_prepareconfig", return_value=session.config)

    def run(self) -> NoReturn:
        """Runs what xdist has workers do, and ends."""
        self._config.pluginmanager.register(self)
        self._prepare.start()
        exec(_BOOT)
        os._exit(0)

    @pytest.hookimpl(tryfirst=True)
    def pytest_cmdline_main(self, config: pytest.Config) -> int:
        """Runs the rest of pytest's `wrap_session`, from the end of the collection."""
        self._become_one()
        worker = next(each for each in config.pluginmanager.get_plugins() if type(each).__name__ == "WorkerInteractor")
        worker.pytest_sessionstart(self._session)
        worker.pytest_collection()
        for each in self._failed:
            worker.pytest_collectreport(each)
        worker.pytest_collection_finish(self._session)
        try:
            worker.pytest_runtestloop(self._session)
        except BaseException:  # noqa: BLE001  as pytest does
            config.notify_exception(pytest.ExceptionInfo.from_current(), config.option)
        os.chdir(self._session.startpath)
        config.hook.pytest_sessionfinish(session=self._session, exitstatus=int(self._session.testsfailed > 0))
        config._ensure_unconfigure()
        return 0

    def _become_one(self) -> None:
        self._prepare.stop()
        sys.path, self._config.option.loadgroup = self._path, self._has_groups
        self._config._tmp_path_factory = TempPathFactory.from_config(self._config, _ispytest=True)  # type: ignore[attr-defined]
        _capture(self._config).start_global_capturing()
        _capture(self._config).suspend_global_capture()


def _remote() -> Any:
    return importlib.import_module("xdist.remote")  # pytest warns of a plugin that is imported before it


def _capture(config: pytest.Config) -> Any:
    return config.pluginmanager.getplugin("capturemanager")
