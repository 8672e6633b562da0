#!/opt/ual/bin/python
"""Exit status 0 if the daemons that are registered here serve (grpc.health.v1): all of them, or that of UAL_NS."""

from __future__ import annotations

import os
import sys
from typing import Any

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc

from ual import discovery

LIMIT_S = 3.0
SERVING = health_pb2.HealthCheckResponse.SERVING


def is_serving(address: str) -> bool:
    """Whether the daemon at an address says that it serves."""
    with grpc.insecure_channel(address) as channel:
        stub: Any = health_pb2_grpc.HealthStub(channel)
        try:
            answer = stub.Check(health_pb2.HealthCheckRequest(), timeout=LIMIT_S)
        except grpc.RpcError as error:
            print(f"{address}: {error.code().name}", file=sys.stderr)
            return False
    if answer.status != SERVING:
        print(f"{address}: {health_pb2.HealthCheckResponse.ServingStatus.Name(answer.status)}", file=sys.stderr)
    return bool(answer.status == SERVING)


def main() -> None:
    """Asks the daemons."""
    ns = os.environ.get("UAL_NS")
    found = [each for each in discovery.list_daemons() if ns in (None, each.ns)]
    if not found:
        sys.exit("no daemon is registered")
    sys.exit(0 if all(is_serving(each.address) for each in found) else 1)


if __name__ == "__main__":
    main()
