"""One browser's page: its table and choice of UAVs, what is known of one, its chart, its labels, and its camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import viser

from ual.geometry import Transform
from ual_tools.view import chosen, fleet_table, panel, shell, tree
from ual_tools.view.camera import framing
from ual_tools.view.chart import Chart
from ual_tools.view.command_queue import CommandQueue
from ual_tools.view.control_panel import ControlPanel
from ual_tools.view.fleet import PageFleet
from ual_tools.view.journal import Journal
from ual_tools.view.labels import Labels, camera_of
from ual_tools.view.picture import Moment
from ual_tools.view.scene import below, wxyz, xyz
from ual_tools.view.shown import Shown
from ual_tools.view.team_panel import TeamPanel


class Page:
    """One page. Each browser has one of its own, so that no operator changes what another one looks at.

    Args:
        client: The browser.
        fleet: The UAVs.
        journal: The log.
        top_m: Returns how far above a UAV its label is.
        title: Of the page.
        command_queue: Takes its orders; None: it gives none.

    """

    def __init__(
        self,
        client: viser.ClientHandle,
        fleet: PageFleet,
        journal: Journal,
        top_m: Callable[[str], float],
        title: str,
        command_queue: CommandQueue | None,
    ) -> None:
        self._client = client
        self._fleet = fleet
        self._journal = journal
        self._title = title
        self._control = None if command_queue is None else ControlPanel(command_queue, fleet)
        self._team = None if command_queue is None else TeamPanel(command_queue)
        self._names: tuple[str, ...] = ()
        self._frames: dict[str, viser.FrameHandle] = {}
        self._is_framed = False
        self._labelled = ""
        self._labels = Labels(client, top_m)
        self._moment: Moment | None = None
        gui = client.gui
        self._curtain = _Text(gui.add_html(""))
        if self._control is not None and self._team is not None:
            with gui.add_folder("Control") as folder:
                gui.add_html(f"<div {shell.STOPS_ATTRIBUTE}></div>")
                self._team.build(gui)
                self._control.build_stops(gui, folder)
        self._head = _Text(gui.add_markdown(""))
        self._table = _Text(gui.add_html(""))
        self._choice = gui.add_text(
            shell.CHOICE_LABEL,
            chosen.ALL,
            hint="One, several (uav_1, uav_3), or all: a click on a line chooses it.",
        )
        self._look_at = gui.add_button("Look at it")
        self._details = _Text(gui.add_markdown(""))
        if self._control is not None:
            self._control.build(client)
        with gui.add_folder("Show"):
            self._wants_frames = gui.add_checkbox("Frames", initial_value=False, hint="The tree of frames of the UAV")
            self._wants_pictures = gui.add_checkbox(
                "Pictures", initial_value=False, hint="Fetches the last picture that each UAV has taken, for all pages"
            )
            self._wants_gimbals = gui.add_checkbox(
                "Gimbals", initial_value=False, hint="Where the gimbals of all UAVs look, for all pages"
            )
        with gui.add_folder("Log"):
            self._log = _Text(gui.add_markdown(""))
        self._chart = _chart(gui)
        self._listen()

    @property
    def wants_frames(self) -> bool:
        """Whether the frames are looked at."""
        return bool(self._wants_frames.value)

    @property
    def wants_pictures(self) -> bool:
        """Whether the last pictures are to be fetched."""
        return bool(self._wants_pictures.value)

    @property
    def wants_gimbals(self) -> bool:
        """Whether it is to be shown where gimbals look."""
        return bool(self._wants_gimbals.value)

    def draw(self, moment: Moment) -> None:
        """Draws what follows the camera: with each picture, because labels must stay at their UAVs."""
        self._moment = moment
        if not self._is_framed:
            flying = [uav for uav in moment.uavs.values() if uav.is_flying]
            self._is_framed = self._frame(flying or list(moment.uavs.values()))
        self._labels.update(moment.uavs.values(), frozenset(self._chosen))

    def update(self, moment: Moment) -> None:
        """Shows the moment in the panel."""
        self._offer(tuple(moment.uavs))
        found, ns = self._chosen, self.ns
        self._curtain.set(panel.curtain(moment.utc_s))
        self._head.set(panel.head(moment.utc_s, len(moment.uavs)))
        title = fleet_table.with_alarms(self._title, moment.uavs.values())
        self._table.set(fleet_table.table(moment.uavs.values(), found, title))
        self._label(title)
        self._details.set(self._details_of(ns, moment) if ns else "")
        marks = {each: uav.mark for each, uav in moment.uavs.items()}
        self._chart.update({each: moment.tracks[each] for each in found}, marks, moment.now_s)
        self._log.set(panel.log(self._journal.entries()))
        self._draw_frames(ns if ns and not moment.uavs[ns].is_lost else "")
        if self._control is not None:
            self._control.update(moment, ns)

    def _details_of(self, ns: str, moment: Moment) -> str:
        member = self._fleet.members().get(ns)
        carried = () if member is None else member.carried.rows
        return panel.details(moment.uavs[ns], moment.watched[ns], now_s=moment.now_s, carried=carried)

    def _label(self, title: str) -> None:
        """Heads the panel by the title: that is all that is left of it where it is folded."""
        if title != self._labelled:
            self._labelled = title
            self._client.gui.set_panel_label(title)

    @property
    def _chosen(self) -> tuple[str, ...]:
        """The UAVs that are chosen."""
        return chosen.chosen(str(self._choice.value), self._names)

    @property
    def ns(self) -> str:
        """The only UAV that is chosen; empty: none, or several."""
        found = self._chosen
        return found[0] if len(found) == 1 else ""

    def _offer(self, names: tuple[str, ...]) -> None:
        """Takes the UAVs that there are."""
        if names != self._names:
            self._names = names
            self._tell_choice()

    def _tell_choice(self) -> None:
        if self._control is not None and self._team is not None:
            self._control.choose(self.ns)
            self._team.choose(self._chosen, self._names)

    def _listen(self) -> None:
        # Callbacks that are coroutines run in the order in which the browser sent what they answer to.
        @self._choice.on_update
        async def _(_: object) -> None:
            self._tell_choice()

        @self._look_at.on_click
        async def _(_: object) -> None:
            if self._moment is not None:
                self._frame([uav for ns, uav in self._moment.uavs.items() if ns in self._chosen])

    def _frame(self, uavs: Sequence[Shown]) -> bool:
        """Turns the camera to some UAVs. Returns whether it could."""
        camera = camera_of(self._client)
        above = [(uav, uav.body.position) for uav in uavs if uav.body is not None]
        points = [each for uav, point in above for each in (point, below(uav, point))]
        if camera is None or not points:
            return False
        position, look_at = framing(points, camera.fov_rad, camera.width_px / camera.height_px)
        with self._client.atomic():
            self._client.camera.position = xyz(position)
            self._client.camera.look_at = xyz(look_at)
        return True

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
            self._handle.content = self._text = text  # in this order: what was not drawn is drawn again


def _chart(gui: viser.GuiApi) -> Chart:
    """Adds the chart in a panel of its own below the other one: it stays in sight whatever is scrolled there."""
    below = gui.add_panel()
    chart = Chart(gui, below.add_tab("The last minute"))
    below.dock_below(gui.main_panel)
    return chart
