"""The link to ROS through rosbridge, which the backends of ROS share.

See ``docs/evidence/decisions/0025-our-own-rosbridge-client.md`` for why it is our own.

The modules, from the top down (a contract in pyproject.toml checks it):

- ``link``: one thread that connects, receives, reconnects, and subscribes again; what backends use
- ``slow_calls``: services that may take long, on a connection of their own
- ``graph``: which ROS is on the other side, and which topics of which types
- ``connections``: the two connections of a link, supervised as one
- ``calls``: services that are called, and their time limits
- ``outbox``: what waits to be sent on a connection
- ``operations``: rosbridge's protocol, in JSON and CBOR
- ``websocket``: the connection
- ``fields``, ``ordering``: numbers, arrays and stamps in messages; which of them is the newest, and how late it came
- ``url``
"""

from ual_daemon.backends.rosbridge.graph import Graph, RosGeneration
from ual_daemon.backends.rosbridge.link import RosbridgeLink, RosbridgeState
from ual_daemon.backends.rosbridge.operations import Message
from ual_daemon.backends.rosbridge.url import DEFAULT_URL, BridgeUrl, parse_url

__all__ = [
    "DEFAULT_URL",
    "BridgeUrl",
    "Graph",
    "Message",
    "RosGeneration",
    "RosbridgeLink",
    "RosbridgeState",
    "parse_url",
]
