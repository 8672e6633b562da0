"""The languages of `clients/`: what each needs of the machine, how it is built, and what then flies."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
CLIENTS = ROOT / "clients"
BUF = ROOT / "tools" / "node_modules" / ".bin"


def _has_debian_grpc() -> bool:
    asked = ["pkg-config", "--exists", "grpc++", "protobuf"]
    return shutil.which("pkg-config") is not None and subprocess.run(asked).returncode == 0


@dataclass(frozen=True)
class Language:
    """One folder of `clients/`."""

    name: str
    folder: str
    needed: tuple[str, ...]
    """Programs that build and run it."""
    get: str
    """Installation of missing tools."""
    build: tuple[tuple[str, ...], ...]
    """Commands, run in the folder: those of its README."""
    mission: tuple[str, ...]
    """Command that flies, run in the folder; without a wrapper between us and it, so that Ctrl-C reaches it."""
    has_libraries: Callable[[], bool] = lambda: True
    """Whether the machine has what the build does not fetch by itself."""

    @property
    def path(self) -> Path:
        return CLIENTS / self.folder

    def missing(self) -> str:
        """Why it cannot be built here; empty when it can."""
        programs = [program for program in self.needed if shutil.which(program, path=search_path()) is None]
        if programs:
            return f"{self.name} does not fly here: no {', '.join(programs)}. Get it: {self.get}"
        if not self.has_libraries():
            return f"{self.name} does not fly here: its libraries are not installed. Get them: {self.get}"
        return ""


def search_path() -> str:
    """PATH, with the repository's own buf where there is none."""
    return os.pathsep.join([os.environ.get("PATH", os.defpath), str(BUF)])


LANGUAGES = (
    Language(
        name="Go",
        folder="go",
        needed=("go", "buf"),
        get="https://go.dev/dl and `make tools/node_modules` (buf)",
        build=(
            ("go", "generate", "./..."),
            ("go", "build", "-o", "build/mission", "."),
            ("go", "build", "-o", "build/payload", "./payload"),
        ),
        mission=("build/mission",),
    ),
    Language(
        name="TypeScript",
        folder="typescript",
        needed=("node", "npm"),
        get="Node 20 or newer, https://nodejs.org",
        build=(("npm", "install"), ("npm", "run", "build")),
        mission=("node", "dist/mission.js"),
    ),
    Language(
        name="C++",
        folder="cpp",
        needed=("c++", "cmake", "make", "pkg-config", "protoc", "grpc_cpp_plugin"),
        get="apt-get install g++ cmake make pkg-config libgrpc++-dev libprotobuf-dev protobuf-compiler-grpc",
        build=(
            ("cmake", "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Release"),
            ("cmake", "--build", "build", "--parallel", "2"),
        ),
        mission=("build/mission",),
        has_libraries=_has_debian_grpc,
    ),
    Language(
        name="Rust",
        folder="rust",
        needed=("cargo",),
        get="https://rustup.rs",
        build=(("cargo", "build", "--locked", "--jobs", "2"),),
        mission=("target/debug/mission",),
    ),
    Language(
        name="Java",
        folder="java",
        needed=("java", "javac", "mvn"),
        get="apt-get install openjdk-17-jdk-headless maven",
        build=(("mvn", "--batch-mode", "--quiet", "--no-transfer-progress", "package"),),
        mission=("java", "-jar", "target/mission.jar"),
    ),
)
