"""The node and other programs of ROS 2, run by the Python of its environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from benchmarks.children import REPOSITORY, Child, Process
from tools import ros2

_SOURCES = (REPOSITORY, REPOSITORY / "clients" / "python", REPOSITORY / "clients" / "ros2" / "ual_ros2")
_DOMAIN = "77"


@dataclass(frozen=True)
class Ros:
    """An environment with ROS 2."""

    python: str
    variables: Mapping[str, str]

    @classmethod
    def found(cls, distribution: str) -> Ros:
        """Returns that of a distribution, made where it is not there yet."""
        python, variables = ros2.environment(distribution)
        path = ":".join([variables["PYTHONPATH"], *map(str, _SOURCES)])
        return cls(str(python), {**variables, "PYTHONPATH": path, "ROS_DOMAIN_ID": _DOMAIN})

    def node(self, *parameters: str, runtime_dir: str = "") -> Process:
        """Starts the node with parameters."""
        given = [word for parameter in parameters for word in ("-p", parameter)]
        environment = {**self.variables, **({"UAL_RUNTIME_DIR": runtime_dir} if runtime_dir else {})}
        return Process([self.python, "-m", "ual_ros2", "--ros-args", *given], environment=environment)

    def child(self, module: str, *arguments: str) -> Child:
        """Starts a program of the benchmarks."""
        return Child(module, *arguments, python=self.python, environment=self.variables)

    def process(self, words: Sequence[str]) -> Process:
        """Starts a module with arguments."""
        return Process([self.python, "-m", *words], environment=self.variables)
