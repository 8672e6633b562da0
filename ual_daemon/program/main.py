"""The program ``ual-daemon``: reads its configuration, and runs one daemon until a signal comes.

Exit status: 0 after a clean end, 1 if it cannot start (port or namespace in use), 2 for wrong usage or configuration.
It is 3 if it had to leave a UAV in motion.
Heavy modules are imported late, so that the port is open soon.
"""

from __future__ import annotations

import dataclasses
import errno
import gc
import logging
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click
from click.core import ParameterSource
from msgspec import structs
from typing_extensions import override

from ual.shared import environment
from ual_daemon import logs
from ual_daemon._version import __version__
from ual_daemon.program import log_output
from ual_daemon.program.configuration import (
    Configuration,
    ConfigurationError,
    DaemonSettings,
    FlagSource,
    ValuesSource,
    located,
    nested,
    resolve,
)
from ual_daemon.settings import ConfigError, VehicleSettings

if TYPE_CHECKING:
    from contextlib import ExitStack

    from ual_daemon.backends.base import Backend, BackendOptions
    from ual_daemon.choice import ServedVehicle
    from ual_daemon.program.daemon import Callers
    from ual_daemon.program.metrics.gathering import ProcessMetrics
    from ual_daemon.program.network.publisher import Publisher
    from ual_daemon.program.recording.audit import Audit
    from ual_daemon.program.recording.recording import DaemonRecording
    from ual_daemon.program.worker import Worker
    from ual_daemon.server.addresses import Address
    from ual_daemon.ual import UAL

_log = logging.getLogger(__name__)

_CANNOT_START_STATUS = 1
_WRONG_USAGE_STATUS = 2
_LEFT_IN_MOTION_STATUS = 3
_SWITCH_S = 0.0005
"""Seconds after which a thread that computes (a plan) yields to one that flies or serves. With Python's default, 5 ms,
a thread that waits for messages would wait as long at each step, several times for each message.
"""


class Count(click.ParamType[int | str]):
    """A number in decimal digits, or one of the words. `int` would also read ``8_0``, and digits of other scripts."""

    name = "count"

    def __init__(self, *words: str) -> None:
        self._words = words

    @override
    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> int | str:
        if value in self._words:
            return value
        if not re.fullmatch("-?[0-9]+", value):
            self.fail(f"{value!r} is not {' or '.join(('a whole number', *self._words))}.", param, ctx)
        return int(value)


def _print_version(context: click.Context, _: click.Parameter, is_wanted: bool) -> None:
    if is_wanted and not context.resilient_parsing:
        click.echo(f"ual-daemon {__version__}")
        context.exit()


class _DaemonProgram(click.Command):
    """The program. What it prints may get lost: on a full disk, in a pipe whose reader has left."""

    @override
    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:  # click's
        with _printing():
            return super().make_context(*args, **kwargs)


@contextmanager
def _printing() -> Iterator[None]:
    """Ends the program where standard output is lost: without a word where its reader wanted no more."""
    try:
        yield
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes into it at its end
        if error.errno == errno.EPIPE:
            sys.exit(0)
        _fail(f"the output cannot be printed: {error.strerror}", _CANNOT_START_STATUS)


@click.command(
    cls=_DaemonProgram,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 110,
        "auto_envvar_prefix": "UAL",
    },
)
@click.option("--backend", metavar="NAME", help="The autopilot's driver: light (a simulation), mavlink, ...  [light]")
@click.option("--ns", metavar="NAME", help="The UAV's namespace.  [uav_1]")
@click.option("--fleet", type=Count(), metavar="N", help="Fly N simulated UAVs, counted on from --ns.")
@click.option(
    "--workers",
    type=Count("auto"),
    metavar="N|auto",
    help="Spread the fleet over N processes, or (auto) one for each processor.",
)
@click.option(
    "--fleet-url",
    multiple=True,
    metavar="URL",
    help="Fly the vehicle at this URL in this process, and those of further --fleet-url.",
)
@click.option("--url", help="Where the autopilot is, as the backend expects it.")
@click.option(
    "--listen",
    multiple=True,
    metavar="ADDRESS",
    help="Where to serve, HOST:PORT or unix:PATH; may be given again.  [127.0.0.1:(50050 + N) for a name ending in _N]",
)
@click.option("--config", "config_file", type=click.Path(path_type=Path), envvar="UAL_CONFIG", help="A YAML file.")
@click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="KEY=VALUE",
    envvar="UAL_SET",
    help="Any key of the file, as limits.climb_speed_m_s=2; may be given again.",
)
@click.option("--allow-arming/--no-allow-arming", default=None, help="Let callers arm a real UAV.")
@click.option("--auto-arm/--no-auto-arm", default=None, help="A simulated pilot arms whenever the UAV stands ready.")
@click.option(
    "--watch-only/--no-watch-only", default=None, help="Only report: refuse every command, send nothing that flies."
)
@click.option("--record", metavar="DIR", help="Record everything into MCAP files in this directory.")
@click.option(
    "--record-raw/--no-record-raw",
    default=None,
    help="With --record: the autopilot's packets, too, so that the flight can be replayed.",
)
@click.option("--record-pictures/--no-record-pictures", default=None, help="With --record: what the cameras take, too.")
@click.option("--extension", multiple=True, metavar="NAME", help="Load an extension; may be given again.")
@click.option("--insecure/--no-insecure", default=None, help="Serve other computers without TLS.")
@click.option("--tls-certificate", metavar="FILE", help="Serve with TLS: the certificate (chain), PEM.")
@click.option("--tls-key", metavar="FILE", help="Its private key, PEM.")
@click.option(
    "--tls-client-ca",
    metavar="FILE",
    help="Callers by TLS show a certificate of this authority, PEM; --roles says what each may do.",
)
@click.option("--tokens", metavar="FILE", help="Callers may show a token of this file (`ual token new`).")
@click.option("--roles", metavar="FILE", help="What each certificate and token may do, YAML.")
@click.option("--audit", metavar="FILE", help="Append a line to this file for each call that changes something.")
@click.option(
    "--audit-required/--no-audit-required",
    default=None,
    help="Accept no motion while the audit cannot be written; landing, aborting and disarming are always accepted.",
)
@click.option("--metrics", metavar="HOST:PORT", help="Serve metrics for Prometheus there, over HTTP.")
@click.option(
    "--network",
    is_flag=False,
    flag_value="loopback",
    metavar="[FILE]",
    help="Be found by programs of other computers, as this YAML file says; without one, by those of this computer.",
)
@click.option(
    "--transport",
    type=click.Choice(["auto", "core", "aio"]),
    help="How gRPC is served: on its core, by grpc.aio, or what works best here.  [auto]",
)
@click.option("--log-level", type=click.Choice(["debug", "info", "warning", "error"]), help="[info]")
@click.option("--log-format", type=click.Choice(["text", "json"]), help="[text]")
@click.option("--print-config", is_flag=True, allow_from_autoenv=False, help="Check the configuration, print it, end.")
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    allow_from_autoenv=False,
    callback=_print_version,
    help="Print the version, end.",
)
@click.pass_context
def main(
    context: click.Context,
    /,
    *,
    config_file: Path | None,
    assignments: tuple[str, ...],
    print_config: bool,
    **flags: object,
) -> None:
    """Flies one UAV, or a fleet, for callers in any process, on any host and in any language.

    Each flag has an environment variable: UAL_BACKEND, UAL_NS, ... Flags win over the environment, that over the
    file, the file over the defaults. SIGTERM and SIGINT end it in a way that is safe for the UAV; a second one ends
    it at once.
    """
    gc.disable()  # saves 10 ms of the start, which makes no garbage; `Daemon.run` enables it
    try:
        if mistake := environment.mistake_in(os.environ):
            _fail(mistake, _WRONG_USAGE_STATUS)
        _run(_sources(context, config_file, assignments, flags), print_config=print_config)
    except (ConfigurationError, ConfigError) as error:
        _fail(str(error), _WRONG_USAGE_STATUS)
    finally:
        gc.enable()


def _sources(
    context: click.Context, config_file: Path | None, assignments: tuple[str, ...], flags: dict[str, object]
) -> list[ValuesSource]:
    """Returns the sources of the settings; each one wins over those before it."""
    if config_file is not None or assignments:
        from ual_daemon.program import configuration_yaml  # imported late, for a faster start
    sources: list[ValuesSource] = [] if config_file is None else [configuration_yaml.read_file(config_file)]
    for origin in (ParameterSource.ENVIRONMENT, ParameterSource.COMMANDLINE):
        values = {name: value for name, value in flags.items() if context.get_parameter_source(name) is origin}
        sources.append(FlagSource(values, {name: _option_text(name, origin) for name in values}))
        if context.get_parameter_source("assignments") is origin:
            name = _option_text("set", origin)
            for text in assignments:
                key, value = configuration_yaml.assignment(text, name)
                sources.append(FlagSource(nested(key, value), {key: f"{name} {key}"}))
    return sources


def _option_text(name: str, origin: ParameterSource) -> str:
    return f"UAL_{name.upper()}" if origin is ParameterSource.ENVIRONMENT else f"--{name.replace('_', '-')}"


def _run(sources: Sequence[ValuesSource], *, print_config: bool) -> None:
    # gRPC writes to stderr without the log's format. The daemon itself logs whatever concerns users.
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    from ual_daemon.backends import registry
    from ual_daemon.program import fleet

    configuration = resolve(sources, registry.NAMES)
    try:
        configuration = _with_each_vehicle(configuration)
        parts = fleet.parts(configuration.daemon)
    except ConfigError as error:
        raise located(error, sources) from None
    if len(parts) == 1 or print_config:
        _fly(configuration, sources, print_config=print_config)
    else:
        _spread(configuration, sources, parts)


def _with_each_vehicle(configuration: Configuration) -> Configuration:
    """Returns the configuration with a URL for each vehicle: one of `fleet_url` may lead to several."""
    from ual_daemon.backends import registry

    settings = configuration.daemon
    if not settings.fleet_url or settings.backend == registry.PLAYED:
        return configuration
    try:
        urls = [each for url in settings.fleet_url for each in registry.vehicle_urls(settings.backend, url)]
    except ConfigError as error:
        raise _of_fleet(error) from None
    return dataclasses.replace(configuration, daemon=structs.replace(settings, fleet_url=tuple(urls)))


def _of_fleet(error: ConfigError) -> ConfigError:
    """Returns the error of a URL as that of the fleet's: each backend knows of one URL."""
    is_url = error.key.rpartition(".")[2] == "url"
    return ConfigError(error.message, "fleet_url" if is_url else error.key)


def _spread(configuration: Configuration, sources: Sequence[ValuesSource], parts: Sequence[range]) -> None:
    """Flies a fleet with several processes. Returns in each of them, but not in the one that starts them."""
    from ual_daemon.program import fleet
    from ual_daemon.program.metrics import opening
    from ual_daemon.program.recording.audit_file import AuditError, AuditFile
    from ual_daemon.program.supervisor import CannotStartError, FleetSupervisor

    settings = configuration.daemon
    try:
        names = fleet.names(settings.ns, parts[-1].stop)
        audit = None if settings.audit is None else AuditFile(Path(settings.audit))
        supervisor = FleetSupervisor(names, parts, audit, opening.exporter(settings))
        worker = supervisor.start()
        if worker is None:
            sys.exit(supervisor.run(settings.log_level, settings.log_format))
    except ConfigError as error:
        raise located(error, sources) from None
    except (AuditError, opening.MetricsError) as error:
        _fail(str(error), _CANNOT_START_STATUS)
    except CannotStartError as error:
        _fail(str(error), error.status)
    try:
        _fly(configuration, sources, worker)
    except (ConfigurationError, ConfigError) as error:
        worker.fail(str(error), _WRONG_USAGE_STATUS)


def _fly(
    configuration: Configuration,
    sources: Sequence[ValuesSource],
    worker: Worker | None = None,
    *,
    print_config: bool = False,
) -> None:
    """Flies all UAVs, or those of a worker."""
    settings = configuration.daemon
    _choose_poller(configuration)  # gRPC reads it when it is imported
    from ual_daemon.program import heap

    heap.limit()  # before there are threads
    from ual_daemon.program import access_files
    from ual_daemon.program.metrics import opening
    from ual_daemon.server import tls
    from ual_daemon.ual import UAL

    try:
        uavs = _fleet(configuration, worker) if configuration.is_fleet else [_one(configuration)]
        interfaces = [UAL.over(each.vehicle, configuration.extensions) for each in uavs]
        credentials = tls.credentials(settings.tls_certificate, settings.tls_key, settings.tls_client_ca)
        who_may = access_files.access(settings)
        _refuse_exposure(uavs[0].listen, is_safe=settings.insecure or credentials is not None)
        opening.address_of(settings)
        network = _network(configuration)
        _refuse_arming_while_watching(settings)
        if settings.audit_required and settings.audit is None:
            raise ConfigError("which file? Give --audit FILE, too", "audit_required")  # noqa: TRY301
        if settings.auto_arm and uavs[0].vehicle.safety_pilot() is None:
            where = f" at {settings.url}" if settings.url else ""
            raise ConfigError(  # noqa: TRY301
                f"the {settings.backend} backend flies a real UAV{where}: its safety pilot arms", "auto_arm"
            )
    except ConfigError as error:
        raise located(error, sources) from None
    if print_config:
        from ual_daemon.program import configuration_yaml

        with _printing():
            click.echo(configuration_yaml.dump(configuration.as_values(), configuration.defaults()), nl=False)
        return
    if worker is None:
        log_output.setup(settings.log_level, settings.log_format)
    else:
        worker.set_up_logs(settings.log_level, settings.log_format)
    _warn_of_callers(settings, uavs[0].listen, has_tls=credentials is not None)
    from ual_daemon.program.daemon import Callers

    _serve(configuration, uavs, interfaces, Callers(credentials, who_may), worker, network)


def _choose_poller(configuration: Configuration) -> None:
    """Lets one thread less be on the path of each message where only this computer calls: decisions 10 and 20."""
    from ual_daemon.server import addresses

    if configuration.daemon.transport != "aio" and all(map(addresses.is_local, configuration.listen)):
        os.environ.setdefault("GRPC_EXPERIMENTS", "-event_engine_listener")


class _Planned(NamedTuple):
    """One UAV to serve. That its vehicle could be made shows that the frames and the fence are valid."""

    vehicle: ServedVehicle
    listen: list[Address]


def _one(configuration: Configuration) -> _Planned:
    from ual_daemon.backends.base import BackendOptions
    from ual_daemon.server import addresses

    settings = configuration.daemon
    listen = [addresses.parse(text) for text in configuration.listen]
    options = BackendOptions(settings.ns, settings.url, configuration.backends.get(settings.backend, {}))
    return _Planned(_vehicle(settings.backend, options, configuration.vehicle, settings), listen)


def _vehicle(
    backend: str | Backend, options: BackendOptions, vehicle: VehicleSettings, settings: DaemonSettings
) -> ServedVehicle:
    from ual import discovery
    from ual_daemon import choice
    from ual_daemon.frames.home_file import HomeFile

    return choice.make(
        backend,
        options,
        vehicle,
        allow_arming=settings.allow_arming,
        watch_only=settings.watch_only,
        home_file=HomeFile(discovery.home_file(options.ns)),
    )


def _fleet(configuration: Configuration, worker: Worker | None) -> list[_Planned]:
    """Plans all UAVs, or those of a worker. Errors are those of the whole fleet in each of them."""
    from ual_daemon.backends import registry
    from ual_daemon.backends.base import BackendOptions
    from ual_daemon.program import fleet
    from ual_daemon.server import addresses

    settings = configuration.daemon
    if settings.backend == registry.PLAYED:
        raise ConfigError("a recording plays as one UAV: start a daemon for each", "fleet")
    if settings.url is not None:
        raise ConfigError("a fleet needs a URL for each vehicle: give --fleet-url for each", "url")
    section = configuration.backends.get(settings.backend, {})
    urls = fleet.urls(settings.fleet, settings.fleet_url, partial(registry.vehicle_key, settings.backend))
    names = fleet.names(settings.ns, len(urls))
    positions = fleet.grid_positions(urls, settings.fleet_spacing_m)
    listen = [[addresses.parse(text) for text in fleet.addresses(configuration.listen, ns)] for ns in names]
    options = [BackendOptions(ns, url, section) for ns, url in zip(names, urls, strict=True)]
    part = range(len(names)) if worker is None else worker.part
    own = slice(part.start, part.stop)
    try:
        backends = registry.make_fleet(settings.backend, options[own], positions[own], part.start)
    except ConfigError as error:
        raise _of_fleet(error) from None
    fleet.allow_files(max(map(len, fleet.parts(settings))), len(configuration.listen))
    return [
        _Planned(_vehicle(backend, backend.options, fleet.placed(configuration.vehicle, position), settings), where)
        for backend, position, where in zip(backends, positions[own], listen[own], strict=True)
    ]


def _serve(
    configuration: Configuration,
    planned: Sequence[_Planned],
    interfaces: Sequence[UAL],
    callers: Callers,
    worker: Worker | None,
    network: Publisher | None,
) -> None:
    from contextlib import ExitStack

    from ual_daemon.program.aside import outcome
    from ual_daemon.program.daemon import Daemon, DaemonUav
    from ual_daemon.program.metrics import opening
    from ual_daemon.program.namespace import Namespace, NamespaceError
    from ual_daemon.program.recording.audit_file import AuditError
    from ual_daemon.server.addresses import ListenError

    settings = configuration.daemon
    try:
        with ExitStack() as held:
            uavs = []
            for each, interface in zip(planned, interfaces, strict=True):
                namespace = held.enter_context(Namespace(interface.ns))
                uavs.append(DaemonUav(interface.vehicle, namespace, each.listen, interface))
            recording = _recording(settings, [interface.vehicle for interface in interfaces])
            if recording is not None:
                recording.start()
                held.callback(recording.close)
            audit = _audit(settings, worker)
            if audit is not None:
                held.callback(audit.close)
            names = [interface.ns for interface in interfaces]
            metrics = _metrics(settings, worker, names, recording, audit, held)
            daemon = Daemon(
                uavs,
                callers,
                transport=settings.transport,
                is_auto_arming=settings.auto_arm,
                recording=recording,
                audit=audit,
                is_audit_required=settings.audit_required,
                metrics=metrics,
                supervision=worker,
                network=network,
            )
            sys.setswitchinterval(_SWITCH_S)
            are_safe = outcome(daemon.run())
    except (ListenError, NamespaceError, RecordingError, AuditError, opening.MetricsError) as error:
        if worker is not None:
            worker.fail(str(error), _CANNOT_START_STATUS)
        _fail(str(error), _CANNOT_START_STATUS)
    gc.freeze()  # the interpreter's end looks for garbage: seconds, after a large fleet
    if not are_safe:
        sys.exit(_LEFT_IN_MOTION_STATUS)


class RecordingError(Exception):
    """The recording cannot begin."""


def _recording(settings: DaemonSettings, vehicles: Sequence[ServedVehicle]) -> DaemonRecording | None:
    """Returns the recording of the vehicles, if one is wanted."""
    if settings.record is None:
        return None
    from ual.errors import NotSupportedError
    from ual.recording import requirements
    from ual.recording.recorder import Turnover

    try:
        requirements.require("ual-daemon[record]")
    except NotSupportedError as error:
        raise RecordingError(str(error)) from None
    from ual_daemon.program.recording.recording import DaemonRecording

    turnover = Turnover(settings.record_file_mib << 20, settings.record_file_minutes * 60.0)
    try:
        return DaemonRecording(
            Path(settings.record),
            vehicles,
            log_output.text_of,
            turnover,
            is_raw=settings.record_raw,
            has_pictures=settings.record_pictures,
        )
    except OSError as error:
        raise RecordingError(f"cannot record into {settings.record}: {error.strerror or error}") from None


def _metrics(
    settings: DaemonSettings,
    worker: Worker | None,
    names: Sequence[str],
    recording: DaemonRecording | None,
    audit: Audit | None,
    held: ExitStack,
) -> ProcessMetrics | None:
    """Returns the metrics of this process, if they are wanted. They are served until `held` ends."""
    if settings.metrics is None:
        return None
    from ual_daemon.program.metrics import opening
    from ual_daemon.program.metrics.gathering import ProcessMetrics

    metrics = ProcessMetrics(names[0], recording, audit)
    if worker is not None:
        worker.metrics = metrics.samples  # the supervisor serves them
    elif (exporter := opening.exporter(settings)) is not None:
        held.callback(exporter.close)
        exporter.start(metrics.samples)
    return metrics


def _audit(settings: DaemonSettings, worker: Worker | None) -> Audit | None:
    """Returns the audit, if one is wanted."""
    if settings.audit is None:
        return None
    from ual_daemon.program.recording.audit import Audit
    from ual_daemon.program.recording.audit_file import AuditFile, AuditPipe

    return Audit(AuditFile(Path(settings.audit)) if worker is None else AuditPipe(worker.channels.audit))


def _network(configuration: Configuration) -> Publisher | None:
    """Returns what tells the network of the UAVs of this process, if that is wanted."""
    settings = configuration.daemon
    if settings.network is None:
        return None
    from ual_daemon.program import fleet
    from ual_daemon.program.network import setup

    count = fleet.parts(settings)[-1].stop
    names = fleet.names(settings.ns, count) if configuration.is_fleet else [settings.ns]
    return setup.publisher(settings.network, names)


def _warn_of_callers(settings: DaemonSettings, listen: Sequence[Address], *, has_tls: bool) -> None:
    """Warns where tokens cross a network that anybody can read, and where other computers could call, but may not."""
    if all(address.is_local for address in listen):
        return
    if settings.tokens is not None and not has_tls:
        logs.event(_log, logging.WARNING, "tokens_without_tls", why="whoever reads the network can use them")
    if settings.tokens is None and settings.roles is None and not settings.insecure:
        why = "no caller on another computer may do anything: give --tokens, or --tls-client-ca and --roles"
        logs.event(_log, logging.WARNING, "no_callers", why=why)


def _refuse_arming_while_watching(settings: DaemonSettings) -> None:
    for key in ("allow_arming", "auto_arm"):
        if settings.watch_only and getattr(settings, key):
            raise ConfigError(f"a daemon that only watches arms nothing: leave out watch_only or {key}", key)


def _refuse_exposure(listen: Sequence[Address], *, is_safe: bool) -> None:
    from ual.shared.exposure import exposed

    found = exposed(map(str, listen))
    if found and not is_safe:
        raise ConfigError(
            f"{found[0]} can be reached from other computers, which could fly the UAV: "
            "give --tls-certificate and --tls-key, or --insecure where the network is trusted",
            "listen",
        )


def _fail(message: str, status: int) -> NoReturn:
    click.echo(f"ual-daemon: {message}", err=True)
    sys.exit(status)
