"""Access to the live page, without a port: addresses, tokens, and what a page says when its packages are missing."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from snr_sim.cli.live_page import LivePage, add_live_page, print_address
from snr_sim.core.config import Config
from snr_sim.prelude.errors import ConfigError, MissingExtraError, ParameterError
from snr_sim.web import web_loop
from snr_sim.web.access import Access, AccessCheck
from snr_sim.web.live import LiveLoopFactory
from tests.web.dive import parts

ACCESS = Access("127.0.0.1", 8080, "change" * 4, "look" * 6)
OWN = [("host", "127.0.0.1:8080"), ("origin", "http://127.0.0.1:8080")]
COOKIE = ("cookie", f"snr_8080={ACCESS.token}")


def ask(
    kind: str, headers: list[tuple[str, str]], query: str = "", method: str = "GET", access: Access = ACCESS
) -> Any:
    """Return what a request leads to: the rights with which it is let through, or the messages that refuse it."""
    sent: list[dict[str, Any]] = []
    rights: list[str] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        rights.append(scope["state"]["rights"])

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": kind, "path": "/machine/diver/", "query_string": query.encode(), "method": method,
        "headers": [(name.encode(), value.encode()) for name, value in headers],
    }  # fmt: skip
    asyncio.run(AccessCheck(app, access)(scope, receive, send))
    return rights[0] if rights else sent


def is_refused(answer: Any) -> bool:
    """Whether a request was refused before the application: status 403, or a WebSocket that was not accepted."""
    return answer[0].get("status") == 403 or answer[0]["type"] == "websocket.close"


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_own_page_with_the_token_is_let_through(kind: str) -> None:
    assert ask(kind, [*OWN, COOKIE]) == "change"
    assert ask(kind, [*OWN, ("cookie", f"other=1; snr_8080={ACCESS.read_token}")]) == "look"


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    "headers",
    [
        [*OWN],
        [*OWN, ("cookie", "snr_8080=")],
        [*OWN, ("cookie", "snr_8080=wröng")],
        [*OWN, ("cookie", f"snr_8081={ACCESS.token}")],
        [*OWN, ("cookie", f"snr_8080={ACCESS.token}x")],
        [OWN[1], COOKIE],
        [OWN[0], ("host", "evil.example"), OWN[1], COOKIE],
        [("host", "127.0.0.1"), OWN[1], COOKIE],
        [("host", "127.0.0.1:8080.evil.example"), OWN[1], COOKIE],
        [OWN[0], ("origin", "http://127.0.0.1:8080.evil.example"), COOKIE],
        [OWN[0], ("origin", "https://127.0.0.1:8080"), COOKIE],
        [OWN[0], ("origin", "null"), COOKIE],
        [*OWN, OWN[1], COOKIE],
    ],
)
def test_any_other_request_is_refused(kind: str, headers: list[tuple[str, str]]) -> None:
    assert is_refused(ask(kind, headers))


def test_connection_without_origin_is_refused_and_a_page_is_not() -> None:
    assert is_refused(ask("websocket", [OWN[0], COOKIE]))
    assert ask("http", [OWN[0], COOKIE]) == "change"  # a browser sends none when an address is opened


def test_token_of_the_address_opens_no_connection() -> None:
    assert is_refused(ask("websocket", OWN, f"token={ACCESS.token}"))


PROGRAMS = replace(ACCESS, is_for_programs=True)


@pytest.mark.parametrize("origin", [[], [OWN[1]]])
def test_program_is_let_through_with_the_token_in_its_address(origin: list[tuple[str, str]]) -> None:
    assert ask("websocket", [OWN[0], *origin], f"token={ACCESS.token}", access=PROGRAMS) == "change"
    assert ask("websocket", [OWN[0], *origin], f"read={ACCESS.read_token}", access=PROGRAMS) == "look"


@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ([OWN[0], ("origin", "http://evil.example")], f"token={ACCESS.token}"),
        ([OWN[0], ("origin", "null")], f"token={ACCESS.token}"),
        ([OWN[0], OWN[1], OWN[1]], f"token={ACCESS.token}"),
        ([("host", "evil.example")], f"token={ACCESS.token}"),
        ([OWN[0]], f"token={ACCESS.token}x"),
        ([OWN[0], COOKIE], ""),
    ],
)
def test_program_of_a_foreign_page_or_without_the_token_is_refused(headers: Any, query: str) -> None:
    assert is_refused(ask("websocket", headers, query, access=PROGRAMS))


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_pages_are_only_read(method: str) -> None:
    assert is_refused(ask("http", [*OWN, COOKIE], method=method))


@pytest.mark.parametrize("query", ["token=wrong", "read=wrong", "token=", "tokens", "&&&", "token=%ff"])
def test_wrong_token_in_the_address_is_refused(query: str) -> None:
    assert is_refused(ask("http", [OWN[0]], query))


@pytest.mark.parametrize(("key", "token"), [("token", ACCESS.token), ("read", ACCESS.read_token)])
def test_token_in_the_address_becomes_a_cookie(key: str, token: str) -> None:
    start, _ = ask("http", [OWN[0]], f"{key}={token}")
    headers = dict(start["headers"])
    assert (start["status"], headers[b"location"]) == (303, b"/machine/diver/")
    assert headers[b"set-cookie"] == f"snr_8080={token}; Path=/; HttpOnly; SameSite=Strict".encode()


def test_address_of_version_6_is_in_brackets() -> None:
    assert Access("::1", 80).origin == "http://[::1]:80"


# -- factories and options --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"port": 70_000}, "70000 is not a valid port of a live page"),
        ({"host": "192.0.2.7"}, "A live page on 192.0.2.7 needs a token of your own"),
        ({"host": "0.0.0.0", "token": "a" * 16}, "cannot be on all addresses"),
        ({"host": "192.0.2.7", "token": "short"}, "has 5 bytes, but needs at least 16"),
    ],
)
def test_factory_with_unsafe_options_raises(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        LiveLoopFactory(**options)


def test_own_token_is_used() -> None:
    assert LiveLoopFactory(token="sesame-open-sesame").access.token == "sesame-open-sesame"


def test_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web_loop, "find_spec", lambda name: None if name == "uvicorn" else object())
    with pytest.raises(MissingExtraError, match="needs the package 'uvicorn'") as error:
        LiveLoopFactory()
    assert "snr_sim[web]" in error.value.fix


def test_page_is_added_to_the_first_role_with_a_machine(capsys: pytest.CaptureFixture[str]) -> None:
    config = Config(factories={"other": [parts()[0]], "r": parts(), "s": parts()})
    live = add_live_page(config, ["other", "r", "s"], LivePage(), "a dive")
    assert "machines of role 'r' only, not those of s" in capsys.readouterr().err
    assert config.get("r")[0] is live
    assert live not in config.get("other")


def test_run_without_a_machine_has_no_page() -> None:
    with pytest.raises(ParameterError, match="this run has none") as error:
        add_live_page(Config(factories={"r": parts()[:1]}), ["r"], LivePage(), "")
    assert "--controller FILE.lrp" in error.value.fix


def test_options_of_the_page_need_live() -> None:
    assert LivePage.of_options(False, 0, "127.0.0.1", None) is None
    assert LivePage.of_options(True, 80, "127.0.0.1", None) == LivePage(80)
    with pytest.raises(ParameterError, match="are of --live"):
        LivePage.of_options(False, 80, "127.0.0.1", None)


@pytest.mark.parametrize(
    ("host", "words"),
    [("127.0.0.1", "Only this computer can reach it"), ("192.0.2.7", "can take the token and steer the robot")],
)
def test_address_says_who_can_reach_it(host: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    live = LiveLoopFactory(8080, host, "a" * 16)
    print_address(live)
    shown = capsys.readouterr().err
    assert f"Open http://{host}:8080/?token={'a' * 16}" in shown
    assert words in shown
    assert f"?read={live.access.read_token}" in shown
