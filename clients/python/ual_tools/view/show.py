"""Runs the page: looks at the UAVs ten times a second, draws what has changed, and keeps each browser's panel."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from itertools import count

import viser

from ual.geometry import Vector3
from ual_tools.session import CommandSession
from ual_tools.view.access import PageAccess
from ual_tools.view.command_queue import CommandQueue
from ual_tools.view.fences import Fences
from ual_tools.view.fleet import TELEMETRY_RATE_HZ, PageFleet
from ual_tools.view.gimbals import PageGimbals
from ual_tools.view.journal import Journal
from ual_tools.view.map_source import MapPicture, Tiles
from ual_tools.view.models import MODELS
from ual_tools.view.page import Page
from ual_tools.view.picture import Moment
from ual_tools.view.picture import PagePicture as Looker
from ual_tools.view.pictures import PagePictures
from ual_tools.view.scene import Scene
from ual_tools.view.server import serving
from ual_tools.view.shown import MODEL_NAMES

_log = logging.getLogger(__name__)

_PICTURE_PERIOD_S = 1.0 / TELEMETRY_RATE_HZ
_PANEL_WIDTH_PX = 420.0
_PICTURES_PER_PANEL = 3
"""The panels are written with each third picture: nobody reads faster."""


@dataclass(frozen=True)
class Choice:
    """Content of the page: UAVs besides those of this computer, their models, and the map below, if there is one.

    `models` has the model of each UAV that has one of its own, and under the empty name that of all others.
    """

    addresses: Sequence[str] = ()
    models: Mapping[str, str] = field(default_factory=dict)
    ground: Tiles | MapPicture | None = None


def title(*, control: bool) -> str:
    """Returns the title of the pages."""
    return f"UAL{' - CONTROL' if control else ''}"


def show(session: CommandSession, choice: Choice, where: PageAccess, *, control: bool) -> None:
    """Serves the page until Ctrl-C."""
    journal = Journal()
    fleet = PageFleet(session, choice.addresses, journal)
    # What flies does so over gRPC, and so needs a connection to each.
    joined = None if control else session.joined
    running = fleet.running() if joined is None else fleet.running_on(joined.network())
    with serving(where, title(control=control), session.tell) as server, running:
        viewer = Viewer(server, fleet, journal, choice, control=control)
        url = where.url(server.get_port())
        session.emit({"url": url, "control": control}, f"{url}   {'can fly' if control else 'shows only'}; Ctrl-C ends")
        with viewer.map_running():
            viewer.run()


class Viewer:
    """All pages of one server.

    Args:
        server: viser's.
        fleet: The UAVs.
        journal: The log.
        choice: Which UAVs, and their models.
        control: Whether the pages may fly.

    """

    def __init__(
        self, server: viser.ViserServer, fleet: PageFleet, journal: Journal, choice: Choice, *, control: bool
    ) -> None:
        self._server = server
        self._fleet = fleet
        self._journal = journal
        self._is_control = control
        self._picture = Looker(fleet.board, journal)
        self._choice = choice
        self._fences = Fences(server.scene, fleet)
        self._pictures = PagePictures(server.scene, fleet)
        self._gimbals = PageGimbals(server.scene, fleet)
        self._scene = Scene(server.scene, self._model_of, self._route_of)
        self._lock = threading.Lock()
        self._pages: dict[int, Page] = {}
        self._title = title(control=control)
        server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        server.gui.set_panel_label(self._title)
        server.gui.main_panel.dock_right()  # beside the scene: floating, it would hide UAVs
        server.gui.main_panel.set_width(_PANEL_WIDTH_PX)
        server.initial_camera.position = (-3.0, -9.0, 6.0)
        server.initial_camera.look_at = (1.5, 0.0, 1.0)
        server.on_client_connect(self._open)
        server.on_client_disconnect(self._close)

    def map_running(self) -> AbstractContextManager[None]:
        """Draws the map, if there is one, while the block runs."""
        if self._choice.ground is None:
            return nullcontext()
        from ual_tools.view.map_layer import MapLayer

        return MapLayer(self._server.scene, self._fleet.board, self._choice.ground, self._journal).running()

    def run(self) -> None:
        """Draws until Ctrl-C."""
        due_s = time.monotonic()
        for number in count():
            self._try_to_draw(with_panels=number % _PICTURES_PER_PANEL == 0)
            due_s = max(due_s + _PICTURE_PERIOD_S, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))

    def _try_to_draw(self, *, with_panels: bool) -> None:
        """Draws one picture. One that fails does not end the view: the next one is drawn."""
        try:
            self.draw(with_panels=with_panels)
        except RuntimeError:
            _log.warning("a picture was not drawn as a whole", exc_info=True)

    def draw(self, *, with_panels: bool) -> None:
        """Draws one picture."""
        moment = self._picture.update(time.monotonic(), time.time())
        self._scene.update(moment)
        self._gimbals.update(moment)
        with self._lock:
            pages = list(self._pages.values())
        for page in pages:
            page.draw(moment)
        if with_panels:
            self._fences.update()
            self._pictures.update(moment)
            self._update_pages(pages, moment)

    def _update_pages(self, pages: Sequence[Page], moment: Moment) -> None:
        for page in pages:
            page.update(moment)
        self._fleet.wants_frames = any(page.wants_frames for page in pages)
        self._fleet.wants_pictures = any(page.wants_pictures for page in pages)
        self._fleet.wants_gimbals = any(page.wants_gimbals for page in pages)
        self._fleet.wants_carried = frozenset(page.ns for page in pages if page.ns)

    def _open(self, client: viser.ClientHandle) -> None:
        command_queue = CommandQueue(self._fleet, self._journal) if self._is_control else None
        page = Page(client, self._fleet, self._journal, self._scene.top_m, self._title, command_queue)
        with self._lock:
            self._pages[client.client_id] = page

    def _close(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._pages.pop(client.client_id, None)

    def _model_of(self, ns: str) -> str:
        named = self._choice.models.get(ns) or self._choice.models.get("")
        member = self._fleet.members().get(ns)
        backend = "" if member is None else member.info.backend
        return named or (backend if backend in MODELS else MODEL_NAMES[0])

    def _route_of(self, ns: str) -> Sequence[Vector3]:
        member = self._fleet.members().get(ns)
        return () if member is None or member.route is None else member.route.points
