"""The panel of one browser page: which UAV is looked at, what is known of it, its chart, its frames, and the log."""

from __future__ import annotations

import numpy as np
import viser

from ual._cli.view import panel, tree
from ual._cli.view.chart import Chart
from ual._cli.view.control_panel import ControlPanel
from ual._cli.view.fleet import Fleet
from ual._cli.view.journal import Journal
from ual._cli.view.picture import Moment
from ual._cli.view.scene import wxyz, xyz
from ual.geometry import Transform

ALL = "all UAVs"
_LOOK_FROM = np.array([-4.0, -6.0, 4.0])


class Page:
    """One page. Each browser has one of its own, so that no operator changes what another one looks at.

    Args:
        client: The browser.
        fleet: The UAVs.
        journal: The log.
        control: What may be ordered from the page; None: nothing.

    """

    def __init__(
        self, client: viser.ClientHandle, fleet: Fleet, journal: Journal, control: ControlPanel | None
    ) -> None:
        self._client = client
        self._fleet = fleet
        self._journal = journal
        self._control = control
        self._names: tuple[str, ...] = ()
        self._frames: dict[str, viser.FrameHandle] = {}
        gui = client.gui
        self._curtain = _Text(gui.add_html(""))
        self._head = _Text(gui.add_markdown(""))
        self._choice = gui.add_dropdown("UAV", [ALL], initial_value=ALL)
        self._details = _Text(gui.add_markdown(""))
        if control is not None:
            control.build(client)
        self._chart = Chart(gui)
        with gui.add_folder("Show"):
            self._wants_frames = gui.add_checkbox("Frames", initial_value=False, hint="The tree of frames of the UAV")
            self._look_at = gui.add_button("Look at it")
        with gui.add_folder("Log"):
            self._log = _Text(gui.add_markdown(""))
        self._listen()

    @property
    def wants_frames(self) -> bool:
        """Whether the frames are looked at."""
        return bool(self._wants_frames.value)

    def update(self, moment: Moment) -> None:
        """Shows the moment."""
        self._offer(tuple(moment.uavs))
        ns = self._ns
        self._curtain.set(panel.curtain(moment.utc_s))
        self._head.set(panel.head(moment.utc_s, len(moment.uavs)))
        if ns:
            self._details.set(panel.details(moment.uavs[ns], moment.seen[ns], now_s=moment.now_s))
        else:
            self._details.set(panel.everyone(moment.uavs.values()))
        self._chart.update(moment.tracks.get(ns), moment.now_s)
        self._log.set(panel.log(self._journal.lines()))
        self._draw_frames(ns if ns and not moment.uavs[ns].is_lost else "")
        if self._control is not None:
            self._control.update(moment, ns)

    @property
    def _ns(self) -> str:
        """The UAV that is looked at; empty: all of them."""
        chosen = str(self._choice.value)
        return chosen if chosen in self._names else ""

    def _offer(self, names: tuple[str, ...]) -> None:
        """Offers the UAVs that there are. A page with a single UAV looks at it."""
        if names == self._names:
            return
        is_first = not self._names
        chosen = self._ns
        self._names = names
        self._choice.options = (ALL, *names)
        wanted = names[0] if is_first and len(names) == 1 else chosen
        self._choice.value = wanted if wanted in names else ALL  # type: ignore[misc]
        if self._control is not None:
            self._control.choose(self._ns)

    def _listen(self) -> None:
        # Callbacks that are coroutines run in the order in which the browser sent what they answer to.
        @self._choice.on_update
        async def _(_: object) -> None:
            if self._control is not None:
                self._control.choose(self._ns)

        @self._look_at.on_click
        async def _(_: object) -> None:
            self._turn_camera()

    def _turn_camera(self) -> None:
        seen = self._fleet.board.seen().get(self._ns)
        transform = None if seen is None or seen.telemetry is None else seen.telemetry.transform
        if transform is not None:
            place = np.array(xyz(transform.translation))
            self._client.camera.position = place + _LOOK_FROM
            self._client.camera.look_at = place

    def _draw_frames(self, ns: str) -> None:
        member = self._fleet.members().get(ns) if self.wants_frames else None
        found = {} if member is None or member.frames is None else tree.in_map(member.frames)
        for name in self._frames.keys() - found.keys():
            self._frames.pop(name).remove()
        for name, transform in found.items():
            self._draw_frame(name, transform)

    def _draw_frame(self, name: str, transform: Transform) -> None:
        handle = self._frames.get(name)
        if handle is None:
            path = f"/frames/{name.replace('/', '.')}"
            handle = self._client.scene.add_frame(path, axes_length=0.6, axes_radius=0.02)
            self._client.scene.add_label(f"{path}/label", name, font_screen_scale=0.8)
            self._frames[name] = handle
        handle.position, handle.wxyz = xyz(transform.translation), wxyz(transform.rotation)


class _Text:
    """A text of the panel, which is sent only when it has changed."""

    def __init__(self, handle: viser.GuiMarkdownHandle | viser.GuiHtmlHandle) -> None:
        self._handle = handle
        self._text = ""

    def set(self, text: str) -> None:
        """Shows a text."""
        if text != self._text:
            self._text = self._handle.content = text
