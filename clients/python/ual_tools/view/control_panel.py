"""The part of a page that flies. It exists only with ``--control``: without it, no handler of it is registered."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import viser

from ual import Uav
from ual.errors import LeaseLostError
from ual.geometry import Vector3
from ual.simulation import (
    BatteryLow,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual_tools.simulation import fault_name
from ual_tools.view import orders, panel
from ual_tools.view.command_queue import CommandQueue, Proposal
from ual_tools.view.fleet import PageFleet
from ual_tools.view.orders import Order
from ual_tools.view.picture import Moment
from ual_tools.view.scene import xyz
from ual_tools.view.shown import Shown

_FAULTS: dict[str, type[Fault]] = {
    fault_name(kind): kind
    for kind in (LinkLost, PositionLost, EstimatorJumps, MotorsWeak, BatteryLow, FailsafeTriggered)
}
_HELP = "Choose a UAV. A click on the ground asks for a go-to at the goal's height."


class ControlPanel:
    """The buttons of one page. Each names the UAV that it is for; none is there while no single UAV is chosen.

    What begins a motion asks first (a dry run), and shows the answer with a button to confirm it. What stops one acts
    at once.
    """

    def __init__(self, command_queue: CommandQueue, fleet: PageFleet) -> None:
        self._command_queue = command_queue
        self._fleet = fleet
        self._ns = ""
        self._ground_m = 0.0
        self._count = -1
        self._named: list[tuple[viser.GuiButtonHandle, str]] = []

    def build_stops(self, gui: viser.GuiApi, folder: viser.GuiFolderHandle) -> None:
        """Adds what stops a flight, and the place of every answer and question. `folder` is where they are."""
        self._gui, self._folder = gui, folder
        self._stops = [
            self._add(gui, "Abort (stop)", "red", lambda: self._run("abort", lambda uav: uav.abort())),
            self._add(gui, "Land", "red", lambda: self._run("land", lambda uav: uav.land(blocking=False))),
        ]
        for button in self._stops:
            button.visible = False
        self._text = gui.add_markdown(_HELP)
        self._confirm: viser.GuiButtonHandle | None = None
        self._cancel = gui.add_button("Cancel", visible=False)

    def build(self, client: viser.ClientHandle) -> None:
        """Adds the other buttons to the page."""
        gui = client.gui
        self._buttons = gui.add_folder("Fly", visible=False)
        self._simulation = gui.add_folder("Simulation", visible=False, expand_by_default=False)
        with self._buttons:
            self._build_flight(gui)
        with self._simulation:
            self._build_simulation(gui)
        self._marker = client.scene.add_icosphere("/goal", radius=0.2, color=(255, 127, 14), opacity=0.7, visible=False)
        self._on(self._cancel, self._command_queue.withdraw)
        self._listen_to_ground(client)

    def choose(self, ns: str) -> None:
        """Takes another UAV. What was proposed is withdrawn."""
        if ns == self._ns:
            return
        self._ns = ns
        self._command_queue.withdraw()
        for button, what in self._named:
            button.label = f"{what} {ns}"
        self._buttons.visible = bool(ns)
        for stop in self._stops:
            stop.visible = bool(ns)

    def update(self, moment: Moment, ns: str) -> None:
        """Shows what is proposed and how the last order went."""
        self._command_queue.tidy(moment.now_s)
        self._refresh(moment.uavs.get(ns))
        member = self._fleet.members().get(ns)
        is_simulation = member is not None and member.info.is_simulation
        if self._simulation.visible != is_simulation:
            self._simulation.visible = is_simulation
        if self._count != self._command_queue.count:
            self._count = self._command_queue.count
            self._show(self._command_queue.proposal)

    def _refresh(self, uav: Shown | None) -> None:
        self._ground_m = 0.0 if uav is None or uav.odom is None else uav.odom.translation.z

    def _show(self, proposal: Proposal | None) -> None:
        # Each proposal has a button of its own: a browser on a slow link may still show the one before.
        if self._confirm is not None:
            self._confirm.remove()
            self._confirm = None
        self._cancel.visible = proposal is not None
        self._marker.visible = proposal is not None and proposal.order.way is not None
        if proposal is None:
            self._text.content = panel.plain(self._command_queue.said or _HELP)
            return
        self._text.content = f"**{panel.plain(proposal.text)}**"
        label = f"Confirm: {proposal.ns}: {proposal.order.what}"
        with self._folder:
            self._confirm = self._gui.add_button(label, color="orange", order=self._text.order + 0.5)
        self._on(self._confirm, partial(self._command_queue.confirm, proposal))
        if proposal.order.way is not None:
            self._marker.position = xyz(proposal.order.way)

    def _build_flight(self, gui: viser.GuiApi) -> None:
        self._height = gui.add_number("Take-off height (m)", 3.0, min=0.0, step=0.5)
        self._add(gui, "Take off", None, lambda: self._propose(orders.take_off(float(self._height.value))))
        self._goal_m = gui.add_number("Goal's height over home (m)", 3.0, step=0.5)
        self._goal = gui.add_vector2("Goal in map (m)", (0.0, 0.0), step=0.5)
        self._add(gui, "Go to goal", None, self._go)
        self._add(gui, "Return home", None, lambda: self._propose(orders.return_to_launch()))
        self._add(gui, "Recover", None, lambda: self._propose(orders.recover()))
        self._add(gui, "Set home of", None, lambda: self._propose(orders.set_home()))
        self._add(gui, "Take lease of", None, self._take_lease)
        self._add(gui, "Release lease of", None, lambda: self._run("release the lease", self._release_lease))

    def _build_simulation(self, gui: viser.GuiApi) -> None:
        for what, act in (
            ("Pilot arms", lambda uav: uav.simulation.pilot_arm()),
            ("Pilot disarms", lambda uav: uav.simulation.pilot_disarm()),
            ("Pilot takes over", lambda uav: uav.simulation.pilot_take_over()),
            ("Pilot gives back", lambda uav: uav.simulation.pilot_give_back()),
        ):
            self._add(gui, what, None, partial(self._run, what.lower(), act))
        self._fault = gui.add_dropdown("Fault", tuple(_FAULTS))
        self._add(gui, "Begin fault of", None, self._begin_fault)
        self._add(gui, "End faults of", None, lambda: self._run("end faults", lambda uav: uav.simulation.end_fault()))

    def _add(self, gui: viser.GuiApi, what: str, colour: str | None, act: Callable[[], None]) -> viser.GuiButtonHandle:
        button = gui.add_button(what, color=colour)  # type: ignore[arg-type]
        self._named.append((button, what))
        self._on(button, act)
        return button

    def _on(self, button: viser.GuiButtonHandle, act: Callable[[], None]) -> None:
        # A coroutine, so that clicks are answered in their order; the command queue gives each call a thread.
        @button.on_click
        async def _(_: object) -> None:
            act()

    def _listen_to_ground(self, client: viser.ClientHandle) -> None:
        @client.scene.on_click()  # type: ignore[arg-type]
        async def _(event: viser.SceneClickEvent) -> None:
            point = orders.on_ground(event.ray_origin, event.ray_direction, self._ground_m)
            if self._ns and point is not None:
                self._goal.value = (round(point.x, 2), round(point.y, 2))  # type: ignore[misc]
                self._go()

    def _go(self) -> None:
        x, y = self._goal.value
        self._propose(orders.go_to(Vector3(float(x), float(y), self._ground_m + float(self._goal_m.value))))

    def _propose(self, order: Order) -> None:
        if self._ns:
            self._command_queue.propose(self._ns, order)

    def _take_lease(self) -> None:
        member = self._fleet.members().get(self._ns)
        if member is not None:
            self._propose(orders.take_lease(member))

    def _release_lease(self, uav: Uav) -> None:
        member = self._fleet.members().get(uav.ns)
        if member is None or member.lease is None:
            raise LeaseLostError("these pages do not hold the lease")
        held, member.lease = member.lease, None  # first this: a second click finds none
        held.release()

    def _begin_fault(self) -> None:
        fault = _FAULTS[str(self._fault.value)]()
        self._run(f"begin {fault_name(type(fault))}", lambda uav: uav.simulation.begin_fault(fault))

    def _run(self, what: str, act: Callable[[Uav], object]) -> None:
        if self._ns:
            self._command_queue.run(self._ns, what, act)
