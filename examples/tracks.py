"""Keeps where UAVs were, in map, and draws it: for the plots of the use cases."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import ual

Point = tuple[float, float]


class Tracks:
    """Positions in map, by the name of the UAV."""

    def __init__(self) -> None:
        self.points: dict[str, list[ual.Vector3]] = {}

    @asynccontextmanager
    async def kept(self, uavs: Mapping[str, ual.aio.Uav]) -> AsyncIterator[None]:
        """Follows the UAVs during the block."""
        tasks = [asyncio.create_task(self._follow(name, uav)) for name, uav in uavs.items()]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _follow(self, name: str, uav: ual.aio.Uav) -> None:
        points = self.points.setdefault(name, [])
        with contextlib.suppress(ual.UalError):  # the track of a UAV that is lost ends there
            to_map = await uav.transform("map", f"{(await uav.info()).namespace}/odom")
            async with uav.subscribe(rate_hz=10.0) as samples:
                async for sample in samples:
                    if sample.pose is not None:
                        points.append(to_map.apply(sample.pose.position))

    def draw(self, file: Path, title: str, marks: Mapping[str, Sequence[Point]]) -> None:
        """Draws the tracks from above and from the side, and marks places. Needs matplotlib."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(10, 4.5), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(title)
        above, side = figure.subplots(1, 2)
        for name, points in self.points.items():
            above.plot([p.x for p in points], [p.y for p in points], label=name, linewidth=1.0)
            side.plot([p.x for p in points], [p.z for p in points], linewidth=1.0)
        for label, places in marks.items():
            above.plot([x for x, _ in places], [y for _, y in places], "x", label=label, markersize=5)
        above.set(xlabel="x (m)", ylabel="y (m)", title="from above, in map", aspect="equal", adjustable="datalim")
        side.set(xlabel="x (m)", ylabel="z (m)", title="from the side")
        side.set_ylim(0.0, 1.1 * max((p.z for points in self.points.values() for p in points), default=1.0))
        above.legend(fontsize="small")
        figure.savefig(file)
