"""The services beside that of the UAV, for asyncio. ``make clients`` writes it: do not edit."""

from __future__ import annotations

from ual import _parameter_calls
from ual.aio._connection import Connection
from ual.parameters.values import Parameter


class Parameters:
    """`ual.interface.Parameters`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Parameters of {self._connection.described}>"

    async def get(self, name: str) -> Parameter:
        """Returns a parameter, read from the autopilot now.

        Raises:
            InvalidArgumentError: It has none of this name.
            LinkLostError: It is not heard.
            UalTimeoutError: It has not answered. Not every autopilot says that it has none of a name.

        """
        return await self._connection.run(_parameter_calls.get(name))

    async def get_all(self) -> list[Parameter]:
        """Returns all parameters, read from the autopilot now. That may take minutes over a slow link.

        Raises:
            LinkLostError: It is not heard.
            UalTimeoutError: Some have not come; the metadata `missing` says how many.

        """
        return await self._connection.run(_parameter_calls.get_all())

    async def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        """Writes a parameter, and returns it as it was read back.

        Args:
            name: The autopilot's own name.
            value: In the autopilot's own unit. A whole number where the parameter is one.
            force: Write it also while the UAV is armed. Those on which a flight relies are refused all the same.

        Raises:
            WrongStateError: The UAV is armed, or that is not known.
            InvalidArgumentError: There is none of this name, or the value does not fit its type.
            RejectedByAutopilotError: The autopilot has kept another value, which the metadata `kept` has.
            LeaseHeldError: Another program holds the lease.
            LinkLostError: It is not heard.
            UalTimeoutError: It has not answered: it is not known whether it was written.

        """
        return await self._connection.run(_parameter_calls.set_(name=name, value=value, force=force))
