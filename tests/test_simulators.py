"""Simulators whose threads race with an end: of a connection, of a bridge, of their own."""

from __future__ import annotations

import json
import socket
import ssl
import threading
from pathlib import Path

import msgspec
from websockets.sync.server import ServerConnection, serve

from tests.simulators.airsim import STEP_S, Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.simulators.dji import Aircraft, OsdkSdkNode
from tests.simulators.rosbridge import Bridge
from tests.simulators.rosbridge_node import served
from tests.simulators.rosbridge_server import RosbridgeServer
from tests.waiting import until

CERTIFICATE = Path(__file__).parent / "data" / "tls"


def test_airsim_serves_on_while_connections_end_and_its_time_is_run() -> None:
    with AirsimServer([Vehicle("drone")]) as server:
        address = ("127.0.0.1", server.port)
        for _ in range(200):
            socket.create_connection(address).close()
            server.run(STEP_S)
        with socket.create_connection(address) as client:
            client.sendall(msgspec.msgpack.encode((0, 1, "listVehicles", [])))
            assert msgspec.msgpack.decode(client.recv(1000)) == [1, 1, None, ["drone"]]


def test_airsim_may_be_run_and_dropped_after_it_has_ended() -> None:
    with AirsimServer([Vehicle("drone")]) as server:
        server.close()
        server.run(STEP_S)
        server.drop_connections()


def test_a_bridge_outlives_a_client_that_refuses_its_certificate() -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(CERTIFICATE / "certificate.pem", CERTIFICATE / "key.pem")
    with RosbridgeServer(Bridge(1, []), tls=context) as server:
        for _ in range(2):
            socket.create_connection(("127.0.0.1", server.port)).close()
        until(lambda: server.accepted_count == 2)


def test_a_node_ends_with_its_bridge() -> None:
    def lose(connection: ServerConnection) -> None:
        while json.loads(connection.recv())["op"] != "publish":
            pass
        connection.socket.shutdown(socket.SHUT_RDWR)  # as a bridge that is killed

    with serve(lose, "127.0.0.1", 0) as bridge:
        accepting = threading.Thread(target=bridge.serve_forever)
        accepting.start()
        with served(bridge.socket.getsockname()[1], OsdkSdkNode(Aircraft())) as node:
            until(node.ended.is_set)
        bridge.shutdown()
        accepting.join()
