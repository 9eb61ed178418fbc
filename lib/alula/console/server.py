"""The server of the operator's page: follows runs, sends every viewer what it lacks, and does what the operator asks for.

A process of its own that only reads files: no viewer, slow, hung or hostile, can hold up a mission.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import sys
import weakref
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.protocol import State

from alula.common.robots import RobotError, RobotFolder, robots_of_fleet
from alula.common.run_log import note_act
from alula.common.runs import is_deployment, runs_folder, up_folder
from alula.common.scenarios import scenario_names
from alula.console import acts, commands
from alula.console.admission import Admission
from alula.console.feed import Feed, place_of
from alula.console.link import ActError, Link
from alula.report.page.embedded import REPORT
from alula.report.page.writing import make_page
from alula.runtime.live.options import RunOffer, RunOption
from alula.runtime.live.spec import RequestError

FEED = "/feed"
STATUS_S = 0.3
"""A viewer that hears nothing for longer than a second knows that what it shows is old."""
STUCK_S = 5.0
"""A viewer that takes nothing for so long is dropped; it comes back by itself and is sent what it lacks."""
OPEN_S = 3.0
"""So long (wall clock) a connection may ask for nothing: browsers open some ahead of need."""
HELLO_S = 5.0
MAX_VIEWERS = 64
MAX_MESSAGE_BYTES = 1 << 14
MAX_COMMANDS_PER_S = 10
LOOK_S = 0.5
SHOWN_RUNS = 20
DEPLOYMENT = "deployment "
"""Begins the name of what is shown of a deployment that is up."""
WAITING = 16
"""So many acts may wait for their answers at once. Those of manual control have threads of their own: none keeps a vehicle from landing."""


@dataclass(eq=False)
class Viewer:
    """A connection that watches. ``key`` is its own secret: a connection that comes back with it is the same viewer."""

    connection: ServerConnection
    key: str
    name: str
    run: str = ""
    may: bool = True
    """Whether it may do more than watch."""
    manual: bool = False
    """Whether manual control is open."""
    commands: list[float] = field(default_factory=list)


class Console:
    """Serves the page of all runs of a robot; ``fixed`` is the one that is shown first, else the newest. ``link`` reaches the robots.

    The runs of the robots ``beside`` it are called ``ROBOT/RUN``, those of its own ``RUN``; those of a fleet's robots, which lie in
    the run of its mission, ``RUN/ROBOT``. Only its own robot's are started here.
    ``ask_offer`` says which options the robot's live runs have; it raises RequestError where none can be started.
    """

    def __init__(
        self,
        admission: Admission,
        link: Link,
        *,
        fixed: Path | None = None,
        beside: Sequence[RobotFolder] = (),
        ask_offer: Callable[[], Awaitable[RunOffer]] | None = None,
    ) -> None:
        self._admission = admission
        self._fixed = fixed
        self._beside = tuple(beside)
        self._fleet = robots_of_fleet()
        self._offers: dict[str, object] = {"scenarios": scenario_names(), "worlds": acts.world_names(), "over": [acts.MOCKS], "options": []}
        self._ask_offer = ask_offer
        self._options: Sequence[RunOption] = ()
        self._page = make_page(title="Alula", entries=None).encode()
        self._feeds: dict[Path, tuple[Feed, asyncio.Task[None]]] = {}
        self._viewers: set[Viewer] = set()
        self._commander = ""
        self._runs: list[Path] = []
        self._live: set[Path] = set()
        self._starting = asyncio.Lock()
        self._commands = commands.Commands(link, lambda: self._options, self._name_of)
        self._threads = {manual: ThreadPoolExecutor(WAITING, "manual" if manual else "acts") for manual in (False, True)}
        self._under_way: dict[tuple[object, ...], asyncio.Task[commands.Done]] = {}
        self._manual: dict[Path, str] = {}
        self._answering: set[asyncio.Task[None]] = set()
        self._problem = ""
        """Why a robot whose run is under way can't be reached."""

    @contextlib.asynccontextmanager
    async def open(self) -> Any:
        """Serve as long as the context lasts."""
        server: Server
        connections: weakref.WeakSet[ServerConnection] = weakref.WeakSet()

        class Known(ServerConnection):
            """A connection that is found at the end whether it has asked for something or not."""

            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                """Note the connection: one that is still at its TLS handshake has no transport yet, and nothing to be aborted."""
                super().connection_made(transport)
                connections.add(self)

        await self._find_runs()  # before the first page is asked for: what a viewer is shown first is served, too
        looking = [
            asyncio.create_task(job)
            for job in (self._learn_options(), self._look_for_runs(), self._look_at_skills(), self._stay_connected())
        ]
        async with serve(
            self._serve_viewer,
            self._admission.host,
            self._admission.port,
            ssl=self._admission.tls,
            process_request=self._answer,
            max_size=MAX_MESSAGE_BYTES,
            write_limit=1 << 18,
            open_timeout=OPEN_S,
            create_connection=Known,
            close_timeout=1,
            compression=None,  # it would take the event loop's time, and most viewers are on this machine
            server_header=None,
        ) as server:
            try:
                yield server
            finally:
                await asyncio.to_thread(self._commands.searches.close)
                for task in [*looking, *(task for _, task in self._feeds.values())]:
                    task.cancel()
                await asyncio.to_thread(self._commands.keep, set(), set())
                for threads in self._threads.values():
                    threads.shutdown(wait=False, cancel_futures=True)
                for connection in list(connections):
                    if connection.state is State.CONNECTING:  # the server would wait for what it asks for
                        connection.transport.abort()

    # --- pages ---------------------------------------------------------------------------------------------------------

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a page; None lets a WebSocket be opened."""
        path = unquote(urlsplit(request.path).path)
        headers = request.headers
        socket = path == FEED
        refusal = self._admission.refusal(
            target=request.path,
            host=headers.get("Host"),
            origin=headers.get("Origin"),
            cookie="; ".join(headers.get_all("Cookie")),
            opens_socket=socket,
        )
        if refusal:
            return self._page_of(HTTPStatus.FORBIDDEN, f"{refusal}\n".encode(), "text/plain; charset=utf-8")
        if socket:
            full = len(self._viewers) >= MAX_VIEWERS
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many viewers\n") if full else None
        if self._admission.brings_token(request.path):  # the token leaves the address, and with it the browser's history
            return self._page_of(HTTPStatus.SEE_OTHER, b"", "text/plain", more={"Location": "/", "Set-Cookie": self._admission.cookie})
        if path == "/":
            return self._page_of(HTTPStatus.OK, self._page, "text/html; charset=utf-8")
        return self._report(path)

    def _report(self, path: str) -> Response:
        run = next((folder for folder in self._runs if path == f"/runs/{self._name_of(folder)}/{REPORT}"), None)
        if run is None or not (run / REPORT).is_file():
            return self._page_of(HTTPStatus.NOT_FOUND, b"there is no such page\n", "text/plain; charset=utf-8")
        # In a sandbox, a page of a run has an origin of its own: nothing in it can command.
        return self._page_of(HTTPStatus.OK, (run / REPORT).read_bytes(), "text/html; charset=utf-8", policy="sandbox allow-scripts")

    def _page_of(
        self, status: HTTPStatus, body: bytes, kind: str, *, policy: str = "frame-ancestors 'none'", more: Mapping[str, str] | None = None
    ) -> Response:
        headers = Headers(
            {
                **(more or {}),
                "Content-Type": kind,
                "Content-Length": str(len(body)),
                "Content-Security-Policy": policy,
                "X-Content-Type-Options": "nosniff",
                "Referrer-Policy": "no-referrer",
                "Cache-Control": "no-store",
                "Connection": "close",
            }
        )
        return Response(status.value, status.phrase, headers, body)

    # --- runs ----------------------------------------------------------------------------------------------------------

    async def _learn_options(self) -> None:
        """Ask once, as it takes a second or two; until then, and where no live run can be started here, the page offers mocks only."""
        try:
            self._options = (await self._ask_offer()).options if self._ask_offer else ()
        except RequestError as error:
            sys.stderr.write(f"alula console: runs can be started over mocks only: {error}\n")
            return
        self._offers |= {"over": [acts.LIVE, acts.MOCKS], "options": [asdict(option) for option in self._options]}

    def _folders(self) -> list[Path]:
        beside = [robot.runs for robot in self._beside]
        return [runs_folder(), *_up_folders(), *beside, *(runs_folder().glob("*") if self._fleet else ())]

    def _robot_of(self, run: Path) -> RobotFolder | None:
        """Return the robot beside the console's own, or of its fleet, that a run is of; None for one of its own."""
        if self._of_fleet(run):
            return self._fleet.get(run.name)
        return next((robot for robot in self._beside if run.parent == robot.runs), None)

    def _of_fleet(self, run: Path) -> bool:
        return bool(self._fleet) and run.parent.parent == runs_folder()

    def _name_of(self, run: Path) -> str:
        if self._of_fleet(run):
            return f"{run.parent.name}/{run.name}"
        if is_deployment(run):
            return f"{DEPLOYMENT}{run.name}"
        robot = self._robot_of(run)
        return run.name if robot is None else f"{robot.name}/{run.name}"

    async def _look_for_runs(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            await self._find_runs()

    async def _find_runs(self) -> None:
        self._runs, self._live = await asyncio.to_thread(self._found)

    def _found(self) -> tuple[list[Path], set[Path]]:
        """Return what can be shown, and what of it is under way: a deployment only while it is up, however many missions it has had."""
        found = commands.runs_in(self._folders(), self._fixed)
        up = [one for one in found if is_deployment(one) and commands.is_live(one)]
        runs = [one for one in found if not is_deployment(one)]
        shown = [*runs[: SHOWN_RUNS - len(up)], *up]
        return [*shown, *runs[SHOWN_RUNS - len(up) :]], {one for one in shown if one in up or commands.is_live(one)}

    async def _look_at_skills(self) -> None:
        """Keep an eye on the skillsets of the runs whose viewers look at them."""
        while True:
            watched = self._watched(manual=True)
            self._manual = {run: await asyncio.to_thread(self._manual_state, run) for run in watched}
            await asyncio.sleep(STATUS_S)

    async def _stay_connected(self) -> None:
        """Be connected to what viewers watch before they command it."""
        while True:
            try:
                await asyncio.to_thread(self._commands.keep, self._watched(), self._watched(manual=True))
                self._problem = ""
            except Exception as error:  # noqa: BLE001 - whatever ROS says, the next try may be better
                self._problem = str(error)
            await asyncio.sleep(STATUS_S)

    def _watched(self, *, manual: bool = False) -> set[Path]:
        """Return the runs under way that are watched or, as the one that is shown first, soon will be; or those under manual control."""
        shown = [self._run_of(viewer) for viewer in self._viewers if viewer.manual or not manual]
        return {run for run in [*shown, *([] if manual else [self._shown_first()])] if run in self._live}

    def _manual_state(self, run: Path) -> str:
        try:
            shown = self._commands.manual_control_of(run).describe()
        except Exception as error:  # noqa: BLE001 - whatever a skillset says, the next look may be better
            shown = {"problems": [f"{type(error).__name__}: {error}"], "skillsets": []}
        return json.dumps({"manual": {"run": self._name_of(run), **shown}})

    def _searches(self, run: Path) -> str:
        """Return what is known of what could have been done in a run."""
        found = {fault: asdict(one) for fault, one in self._commands.searches.found(run).items()}
        return json.dumps({"searches": {"run": self._name_of(run), "found": found}})

    def _run_of(self, viewer: Viewer) -> Path | None:
        """Return the run that a viewer watches: the one that it chose, or the one that is shown first."""
        chosen = next((folder for folder in self._runs if self._name_of(folder) == viewer.run), None)
        return chosen or self._shown_first()

    def _shown_first(self) -> Path | None:
        """Return what is shown to who has chosen nothing: the newest that is under way, a mission before a deployment; else the newest."""
        return self._fixed or next((run for run in self._runs if run in self._live), self._runs[0] if self._runs else None)

    def _feed(self, folder: Path) -> Feed:
        if folder not in self._feeds:
            feed = Feed(folder, self._robot_of(folder))
            self._feeds[folder] = (feed, asyncio.create_task(feed.follow()))
        return self._feeds[folder][0]

    # --- viewers -------------------------------------------------------------------------------------------------------

    async def _serve_viewer(self, connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed, TimeoutError, ValueError, ActError):
            hello = _object(await asyncio.wait_for(connection.recv(), HELLO_S))
            _check_text(hello)
            viewer = Viewer(connection, str(hello.get("key") or secrets.token_hex(8))[:64], str(hello.get("name") or "a viewer")[:40])
            viewer.run, viewer.manual = str(hello.get("run") or ""), hello.get("manual") is True
            viewer.may = self._admission.may_command(str(connection.remote_address[0]))
            self._viewers.add(viewer)
            self._commander = self._commander or (viewer.key if viewer.may else "")
            sending = asyncio.create_task(self._send(viewer, hello))
            try:
                async for message in connection:
                    await self._obey(viewer, _object(message))
            finally:
                sending.cancel()
                self._viewers.discard(viewer)

    async def _send(self, viewer: Viewer, hello: Mapping[str, Any]) -> None:
        """Send what the viewer lacks, and how things are, until it is gone."""
        place, due, searches = place_of(hello), 0.0, ""
        clock = asyncio.get_running_loop().time
        with contextlib.suppress(ConnectionClosed):
            while True:
                run = self._run_of(viewer)
                feed = None if run is None else self._feed(run)
                changed = asyncio.Event() if feed is None else feed.changed
                text = None if feed is None else feed.message(place)
                try:
                    if text is not None:
                        await asyncio.wait_for(viewer.connection.send(text), STUCK_S)
                    if clock() >= due:
                        due = clock() + STATUS_S
                        await asyncio.wait_for(viewer.connection.send(json.dumps({"status": self._status(viewer, run, feed)})), STUCK_S)
                        if run is not None and (found := self._searches(run)) != searches:
                            searches = found
                            await asyncio.wait_for(viewer.connection.send(found), STUCK_S)
                        if viewer.manual and run in self._manual:
                            await asyncio.wait_for(viewer.connection.send(self._manual[run]), STUCK_S)
                except TimeoutError:
                    viewer.connection.transport.abort()
                    return
                if text is None:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(changed.wait(), max(0.0, due - clock()))

    def _status(self, viewer: Viewer, run: Path | None, feed: Feed | None) -> dict[str, Any]:
        commander = next((other.name for other in self._viewers if other.key == self._commander), "")
        return {
            "run": "" if run is None else self._name_of(run),
            "live": run in self._live,
            "deployment": run is not None and is_deployment(run),
            "report": run is not None and (run / REPORT).is_file(),
            "runs": [self._name_of(folder) for folder in self._runs[:SHOWN_RUNS]],
            "underWay": [self._name_of(folder) for folder in self._runs[:SHOWN_RUNS] if folder in self._live],
            **self._offers,
            "commands": viewer.may and viewer.key == self._commander,
            "may": viewer.may,
            "commander": commander,
            "viewers": len(self._viewers),
            "problems": [*([] if feed is None else feed.problems), *([self._problem] if self._problem else [])],
        }

    # --- commands ------------------------------------------------------------------------------------------------------

    async def _obey(self, viewer: Viewer, asked: Mapping[str, Any]) -> None:
        clock = asyncio.get_running_loop().time()
        viewer.commands = [stamp for stamp in viewer.commands if clock - stamp < 1.0] + [clock]
        if len(viewer.commands) > MAX_COMMANDS_PER_S:
            await viewer.connection.close(1008, "too many commands")
            return
        if "watch" in asked:
            viewer.run = str(asked["watch"])[:200]
        elif "manual" in asked:
            viewer.manual = asked["manual"] is True
        else:  # beside one another: a skill that is slow to answer must not keep its operator from landing
            answering = asyncio.create_task(self._answer_command(viewer, str(asked.get("command")), asked))
            self._answering.add(answering)
            answering.add_done_callback(self._answering.discard)

    async def _answer_command(self, viewer: Viewer, command: str, asked: Mapping[str, Any]) -> None:
        try:
            _check_text(asked)
            answer = await self._do(viewer, command, asked)
        except Exception as error:  # noqa: BLE001 - whatever goes wrong, the viewer is told
            answer = f"refused: {error}"
        started = viewer.run if command == "start" else ""
        with contextlib.suppress(ConnectionClosed):
            await viewer.connection.send(json.dumps({"answer": answer, "command": command, "started": started}))

    async def _do(self, viewer: Viewer, command: str, asked: Mapping[str, Any]) -> str:
        run = self._run_of(viewer)
        if not viewer.may:
            raise ActError("without TLS, other machines may only watch; start the console without --plain")
        if command == "take":
            self._commander = viewer.key
            self._note(run, viewer, command, "commands now")
            return "you command now"
        if viewer.key != self._commander:
            raise ActError("you watch; take over first")
        if command == "start":
            async with self._starting:
                done = await self._act(viewer, command, asked, run)
            viewer.run = self._name_of(done.run)
        elif command in commands.ON_THE_FLIGHT:
            done = await asyncio.shield(self._joined(viewer, command, asked, run))
        else:
            done = await self._act(viewer, command, asked, run)
        return done.answer

    def _joined(self, viewer: Viewer, command: str, asked: Mapping[str, Any], run: Path | None) -> asyncio.Task[commands.Done]:
        """Begin an act, or return the one of the same meaning that is under way: pressing again asks for nothing new."""
        key = (command, run, str(asked.get("run")))
        if key not in self._under_way:
            self._under_way[key] = asyncio.create_task(self._act(viewer, command, asked, run))
            self._under_way[key].add_done_callback(lambda _: self._under_way.pop(key))
        return self._under_way[key]

    async def _act(self, viewer: Viewer, command: str, asked: Mapping[str, Any], run: Path | None) -> commands.Done:
        threads = self._threads[command == "skill"]
        done = await asyncio.get_running_loop().run_in_executor(threads, self._commands.do, command, asked, run)
        if done.noted:
            self._note(done.run, viewer, done.what, done.answer)
        return done

    def _note(self, run: Path | None, viewer: Viewer, command: str, answer: str) -> None:
        if run is None or not run.is_dir():
            return
        stamp_s = self._feed(run).last_s
        note_act(run, stamp_s, {"command": command, "by": viewer.name, "answer": answer})


def _up_folders() -> list[Path]:
    with contextlib.suppress(RobotError):
        return [up_folder()]
    return []


def _object(message: str | bytes) -> dict[str, Any]:
    """Return a message's object; raise ValueError when it holds none."""
    value = json.loads(message)
    if not isinstance(value, dict):
        raise ValueError("a message is a JSON object")  # noqa: TRY004 - as for what is no JSON at all
    return value


def _check_text(asked: Mapping[str, Any]) -> None:
    """Refuse halves of characters, which JSON can write and no file, process or log can take; raise ActError."""
    try:
        json.dumps(asked, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise ActError(f"the text holds {error.object[error.start]!r}, half of a character (a lone surrogate)") from error
