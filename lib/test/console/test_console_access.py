"""A page that other machines open: its certificate, its token, and what they may do."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import os
import ssl
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from console_page import Page
from console_serving import WAIT_S, Robot, answer_to, heard
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidMessage

from alula.cli.console import main
from alula.common.network import free_port
from alula.console import commands, server
from alula.console.admission import Admission
from alula.console.certificates import NAME, fingerprint, own_certificate, server_context
from alula.console.server import FEED, Console

TOKEN = "secret"  # noqa: S105


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return own_certificate(tmp_path_factory.mktemp("state"))


class Elsewhere:
    """A console that others are served by, as ``scheme``."""

    def __init__(self, certificate: Path | None) -> None:
        self.admission = Admission("127.0.0.1", free_port(), TOKEN, certificate and server_context(certificate, certificate))
        self.base = f"127.0.0.1:{self.admission.port}"
        self.trust = ssl.create_default_context(cafile=str(certificate)) if certificate else None
        self.link = Robot(abort=lambda: "landing")

    def serve(self, play: Callable[[], Awaitable[None]], fixed: Path) -> None:
        async def story() -> None:
            async with Console(self.admission, self.link, fixed=fixed).open():
                await asyncio.wait_for(play(), 3 * WAIT_S)

        asyncio.run(story())

    async def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        return await asyncio.to_thread(self._get, path, headers)

    def _get(self, path: str, headers: dict[str, str]) -> http.client.HTTPResponse:
        kind = http.client.HTTPConnection if self.trust is None else http.client.HTTPSConnection
        connection = kind(self.base, timeout=WAIT_S, **({} if self.trust is None else {"context": self.trust}))
        connection.request("GET", path, headers=headers)
        return connection.getresponse()

    async def viewer(self, key: str) -> ClientConnection:
        secure = "s" if self.trust else ""
        cookie = f"alula_console_{self.admission.port}={TOKEN}"
        viewer = await connect(
            f"ws{secure}://{self.base}{FEED}",
            origin=f"http{secure}://{self.base}",  # type: ignore[arg-type]
            additional_headers={"Cookie": cookie},
            ssl=self.trust,
        )
        await viewer.send(json.dumps({"key": key}))
        return viewer


def test_over_tls_the_token_leaves_the_address_and_the_page_commands(
    make_run: Callable[..., Path], certificate: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    elsewhere = Elsewhere(certificate)
    assert elsewhere.admission.address == f"https://{elsewhere.base}/?token={TOKEN}"

    async def play() -> None:
        assert (await elsewhere.get("/")).status == 403
        first = await elsewhere.get(f"/?token={TOKEN}")
        assert (first.status, first.headers["Location"]) == (303, "/")
        kept, *rules = str(first.headers["Set-Cookie"]).split("; ")
        assert rules == ["Path=/", "HttpOnly", "SameSite=Strict", "Secure"]
        page = await elsewhere.get("/", Cookie=kept)
        assert page.status == 200
        assert TOKEN not in page.read().decode()
        assert (await elsewhere.get("/", Cookie=kept, Origin=f"http://{elsewhere.base}")).status == 403
        viewer = await elsewhere.viewer("me")
        assert await answer_to(viewer, command="abort", run="run") == "landing"
        with pytest.raises((InvalidMessage, OSError, EOFError)):
            await connect(f"ws://{elsewhere.base}{FEED}")
        assert await answer_to(viewer, command="abort", run="run") == "landing"

    elsewhere.serve(play, make_run())


@pytest.mark.parametrize(
    ("peer", "may"), [("10.0.0.7", False), ("fe80::1", False), ("127.0.0.1", True), ("::1", True), ("::ffff:127.0.0.1", True)]
)
def test_without_tls_other_machines_watch(make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, peer: str, *, may: bool) -> None:
    monkeypatch.setattr(commands, "is_live", lambda _run: True)
    monkeypatch.setattr(server.ServerConnection, "remote_address", property(lambda _self: (peer, 4711)))
    elsewhere = Elsewhere(None)

    async def play() -> None:
        first = await elsewhere.get(f"/?token={TOKEN}")
        assert str(first.headers["Set-Cookie"]).endswith("; Path=/; HttpOnly; SameSite=Strict")
        viewer = await elsewhere.viewer("me")
        status = (await heard(viewer, lambda message: "status" in message))["status"]
        assert (status["may"], status["commands"]) == (may, may)
        answers = [await answer_to(viewer, command=command, run="run") for command in ("take", "abort", "off", "start", "skill")]
        refused = "refused: without TLS, other machines may only watch; start the console without --plain"
        assert answers == [refused] * 5 if not may else answers[:2] == ["you command now", "landing"]

    monkeypatch.setattr("alula.console.acts.everything_off", lambda _run: "nothing was ended")
    elsewhere.serve(play, make_run())


def test_a_browser_drops_the_token_and_says_that_it_may_only_watch(
    browser: Any, make_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server.ServerConnection, "remote_address", property(lambda _self: ("10.0.0.7", 4711)))
    elsewhere = Elsewhere(None)

    async def play() -> None:
        await asyncio.to_thread(look)

    def look() -> None:
        page = Page(browser, elsewhere.admission.address)
        page.wait("document.querySelector('#operator')?.textContent.includes('you may only watch, as this page comes without TLS')")
        assert page.run("location.href") == f"http://{elsewhere.base}/"
        assert page.run("document.cookie") == ""
        assert page.run("[...document.querySelectorAll('#acts button')].every((one) => one.disabled)") is True
        browser.delete_all_cookies()

    elsewhere.serve(play, make_run())


# --- certificates -----------------------------------------------------------------------------------------------------------


def test_the_own_certificate_is_made_once_for_its_user_alone(tmp_path: Path) -> None:
    made = own_certificate(tmp_path / "state")
    before = made.read_bytes()
    assert made.stat().st_mode & 0o777 == 0o600
    assert own_certificate(tmp_path / "state").read_bytes() == before
    assert len(fingerprint(made).split(":")) == 32
    told = subprocess.run(["openssl", "x509", "-noout", "-fingerprint", "-sha256", "-in", made], capture_output=True, text=True, check=True)
    assert told.stdout.strip().endswith(f"={fingerprint(made)}")
    made.write_bytes(b"damaged")
    assert own_certificate(tmp_path / "state").read_bytes() != b"damaged"


def test_one_that_has_run_out_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from datetime import timedelta

    monkeypatch.setattr("alula.console.certificates.VALID", timedelta(hours=1))
    before = own_certificate(tmp_path).read_bytes()
    assert own_certificate(tmp_path).read_bytes() != before


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--certificate", "c.pem"], "--certificate and --key belong together"),
        (["--plain", "--certificate", "c.pem", "--key", "k.pem"], "--plain serves without TLS"),
    ],
)
def test_words_that_do_not_fit_together_end_with_2(words: list[str], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert why in capsys.readouterr().err


def test_files_that_are_no_certificate_end_with_2(tmp_path: Path, certificate: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = own_certificate(tmp_path / "other")
    (tmp_path / "text").write_text("text", encoding="utf-8")
    for one, key, why in ((tmp_path / "none", other, "can't be read"), (tmp_path / "text", other, "PEM"), (certificate, other, "PEM")):
        cut = tmp_path / "certificate"
        if one is certificate:
            cut.write_bytes(certificate.read_bytes().partition(b"-----BEGIN PRIVATE")[0])
            one = cut  # noqa: PLW2901
        assert main(["--certificate", str(one), "--key", str(key)]) == 2
        told = capsys.readouterr().err
        assert told.startswith(f"alula console: {one}")
        assert why in told
        assert told.count("\n") == 1


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start the command, which asks `alula run --options` of a folder where that never answers."""
    started: list[subprocess.Popen[str]] = []
    (tmp_path / "alula").write_text(f"#!/bin/sh\necho $$ > {tmp_path}/asked\nsleep 600\n", encoding="utf-8")
    (tmp_path / "alula").chmod(0o700)
    environment = {**os.environ, "ALULA_STATE": str(tmp_path), "ALULA_ROOT": str(tmp_path)}

    def start(*words: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "alula.cli.console", "--port", str(free_port()), *words]
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment))
        return started[-1]

    yield start
    for process in started:
        process.terminate()
        process.communicate(timeout=WAIT_S)


def first_lines(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Return the address, and the first line on standard error."""
    assert process.stdout is not None
    assert process.stderr is not None
    return process.stdout.readline().strip(), process.stderr.readline().strip()


def test_elsewhere_is_served_over_tls_with_a_fingerprint_and_loopback_plainly(
    console: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    address, known_by = first_lines(console("--host", "0.0.0.0"))  # noqa: S104 - what is tested
    assert address.startswith("https://")
    assert "0.0.0.0" not in address  # noqa: S104
    assert known_by.endswith(f"SHA-256 fingerprint: {fingerprint(tmp_path / 'console' / NAME)}")
    plain, _ = first_lines(console("--host", "0.0.0.0", "--plain"))  # noqa: S104
    assert plain.startswith("http://")
    assert "?token=" in plain
    own, _ = first_lines(console())
    assert own.startswith("http://127.0.0.1:")
    assert "token" not in own


def test_its_end_waits_for_no_answer_and_leaves_no_process(console: Callable[..., subprocess.Popen[str]], tmp_path: Path) -> None:
    process = console()
    first_lines(process)
    asked = tmp_path / "asked"
    until(lambda: asked.exists() and asked.read_text(encoding="utf-8").endswith("\n"))
    process.terminate()
    process.communicate(timeout=WAIT_S)
    assert process.returncode == 0
    until(lambda: not is_group(int(asked.read_text(encoding="utf-8"))))


def is_group(number: int) -> bool:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(number, 0)
        return True
    return False


def until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.01)
