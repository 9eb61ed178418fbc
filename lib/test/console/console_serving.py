"""A console that is served, and clients that talk to it over real sockets on loopback."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
import urllib.error
import urllib.request
from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

from alula.common.network import free_port
from alula.common.robots import RobotFolder
from alula.common.runs import Run
from alula.console.admission import Admission
from alula.console.link import ActError, Link, Skillsets
from alula.console.server import FEED, Console
from alula.runtime.live.options import RunOffer, RunOption

WAIT_S = 120.0

OPTIONS = (
    RunOption("link", "where the robot is", metavar="URL"),
    RunOption("quick", "does not wait", takes_value=False),
    RunOption("record", "what is recorded", default="functional", choices=("functional", "sensors")),
)


class Robot:
    """A link whose one mission does what it is given, and notes when it is connected and closed."""

    def __init__(self, *, abort: Callable[[], str] = str, pause: Callable[[], str] = str, resume: Callable[[], str] = str) -> None:
        self._abort, self._pause, self._resume = abort, pause, resume
        self.domains: list[int] = []
        self.runs: list[Run] = []
        self.closed = 0

    def connect(self, run: Run) -> Robot:
        self.domains.append(run.domain)
        self.runs.append(run)
        return self

    def listen(self, run: Run) -> Skillsets:
        raise ActError(f"nothing is heard in domain {run.domain}")

    def close(self) -> None:
        self.closed += 1

    def abort(self) -> str:
        return self._abort()

    def set_paused(self, *, paused: bool) -> str:
        return self._pause() if paused else self._resume()


class Bench:
    """A console that is served, and its address."""

    def __init__(self, port: int, token: str = "") -> None:
        self.base = f"127.0.0.1:{port}"
        self.token = token

    async def viewer(self, key: str, **hello: object) -> ClientConnection:
        connection = await connect(
            f"ws://{self.base}{FEED}",
            origin=f"http://{self.base}",  # type: ignore[arg-type]
            additional_headers={"Cookie": self.cookie},
            max_size=None,
            open_timeout=WAIT_S,
        )
        await connection.send(json.dumps({"key": key, "name": key, **hello}))
        return connection

    @property
    def cookie(self) -> str:
        return f"alula_console_{self.base.rpartition(':')[2]}={self.token}"

    async def get(self, path: str, **headers: str) -> tuple[int, str]:
        return await asyncio.to_thread(self._get, path, headers)

    def _get(self, path: str, headers: dict[str, str]) -> tuple[int, str]:
        try:
            with urllib.request.urlopen(urllib.request.Request(f"http://{self.base}{path}", headers=headers), timeout=WAIT_S) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()


def serve(
    play: Callable[[Bench], Awaitable[None]],
    *,
    token: str = "",
    fixed: Path | None = None,
    link: Link | None = None,
    beside: Sequence[RobotFolder] = (),
) -> None:
    """Serve a console, and play a story against it."""

    async def story() -> None:
        bench = Bench(free_port(), token)
        admission = Admission("127.0.0.1", int(bench.base.rpartition(":")[2]), token)
        async with Console(admission, link or Robot(), fixed=fixed, beside=beside).open():
            await asyncio.wait_for(play(bench), 3 * WAIT_S)

    asyncio.run(story())


async def heard(viewer: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Return the first message that is as wanted."""
    async with asyncio.timeout(WAIT_S):
        while True:
            message = json.loads(await viewer.recv())
            if wanted(message):
                return dict(message)


async def answer_to(viewer: ClientConnection, **asked: object) -> str:
    await viewer.send(json.dumps(asked))
    return str((await heard(viewer, lambda message: "answer" in message))["answer"])


class Served:
    """A console in a thread of its own, which can be stopped and started."""

    def __init__(self, fixed: Path, link: Link, options: Sequence[RunOption]) -> None:
        self._fixed, self._link, self._options, self.port = fixed, link, options, free_port()
        self._stop: Callable[[], None] = lambda: None

    def start(self) -> None:
        up = threading.Event()

        async def main() -> None:
            over = asyncio.Event()
            loop = asyncio.get_running_loop()
            self._stop = lambda: loop.call_soon_threadsafe(over.set)
            admission = Admission("127.0.0.1", self.port, "")
            async with Console(admission, self._link, fixed=self._fixed, ask_offer=self._told).open():
                up.set()
                await over.wait()

        self._thread = threading.Thread(target=lambda: asyncio.run(main()), daemon=True)
        self._thread.start()
        assert up.wait(WAIT_S)

    async def _told(self) -> RunOffer:
        return RunOffer(tuple(self._options))

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def stop(self) -> None:
        self._stop()
        self._thread.join(WAIT_S)


@contextlib.contextmanager
def served(fixed: Path, link: Link | None = None, options: Sequence[RunOption] = ()) -> Iterator[Served]:
    console = Served(fixed, link or Robot(), options)
    console.start()
    try:
        yield console
    finally:
        console.stop()
