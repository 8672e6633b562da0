"""Bindings to gRPC's core with some of it broken; as a program, a daemon on one of them."""

from __future__ import annotations

from typing import Any

from grpc._cython import cygrpc


class Binding:
    """The binding without what is `missing`, and with `replaced` in the place of the same names."""

    def __init__(self, *missing: str, **replaced: object) -> None:
        self._missing = missing
        self._text = " ".join((*(f"no {name}" for name in missing), *map(str, replaced)))
        vars(self).update(replaced)

    def __getattr__(self, name: str) -> Any:
        if name in self._missing:
            raise AttributeError(f"no {name} any more")
        return getattr(cygrpc, name)

    def __str__(self) -> str:
        return self._text


if __name__ == "__main__":
    from ual_daemon.program.main import main
    from ual_daemon.server.transport import core

    vars(core)["cygrpc"] = Binding("SendMessageOperation")
    main()
