"""Access to a server of pages: each request must have this server's host, its own origin, and a token.

The pages change what a robot does, so each of these must be kept out:

    a page of another site in the same browser    its Origin is another one, and the cookie is SameSite=Strict
    a name that an attacker points to 127.0.0.1   Host is that name (DNS rebinding)
    other users of this computer                  they do not know the token
    who reads over the shoulder, or a log         the token is in the address once; then in a cookie, for this run

What is refused gets status 403, a WebSocket before it is one. What is left: cookies know no ports, so a server of
another user on this host gets the token if its page is opened in the same browser meanwhile.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any, TypeAlias
from urllib.parse import parse_qsl, quote

from snr_sim.web.messages import Rights

Scope: TypeAlias = MutableMapping[str, Any]
Message: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[Message]]
SendMessage: TypeAlias = Callable[[Message], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, SendMessage], Awaitable[None]]

TOKEN_BYTES = 16
# The editor's underlines and gutter marks are images in `data:` addresses, and its styles are written by its script.
POLICY = (
    "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; connect-src 'self'; "
    "worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)


def _new_token() -> str:
    return secrets.token_urlsafe(TOKEN_BYTES)


@dataclass(frozen=True)
class Access:
    """Where a server is, and the tokens that it accepts.

    Args:
        host, port: to which it is bound.
        token: of a browser that may change the robot.
        read_token: of a browser that may only look.
        is_for_programs: whether a WebSocket may come without an origin, and with the token in its address: from a
            program. A browser always sends an origin.
    """

    host: str
    port: int
    token: str = field(default_factory=_new_token, repr=False)
    read_token: str = field(default_factory=_new_token, repr=False)
    is_for_programs: bool = False

    @property
    def netloc(self) -> str:
        """Host and port as in an address."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def origin(self) -> str:
        """The origin of its pages."""
        return f"http://{self.netloc}"

    @property
    def url(self) -> str:
        """The address to open, with the token."""
        return f"{self.origin}/?token={self.token}"

    @property
    def read_url(self) -> str:
        """The address that allows a browser to look only."""
        return f"{self.origin}/?read={self.read_token}"

    @property
    def cookie(self) -> str:
        """The name of its cookie; browsers do not separate cookies by port."""
        return f"snr_{self.port}"

    def rights_of(self, token: str) -> Rights | None:
        """Return what the owner of a token may do; None if it is not one of ours. In constant time."""
        given = token.encode("utf-8", "replace")
        may_change = hmac.compare_digest(given, self.token.encode())
        may_look = hmac.compare_digest(given, self.read_token.encode())
        return "change" if may_change else "look" if may_look else None


class AccessCheck:
    """Application around another one that lets through what may be let through, with the rights in `scope`.

    Args:
        app: the other one; it finds the rights in `scope["state"]["rights"]`.
        access: what is accepted.
    """

    def __init__(self, app: App, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: SendMessage) -> None:
        """Handle a request."""
        kind = scope["type"]
        if kind not in ("http", "websocket"):
            return
        token, asked = self._token(scope)
        if kind == "http" and asked and not self._why_not(scope) and self._access.rights_of(asked):
            await self._keep_token(scope, send, asked)
            return
        is_program = kind == "websocket" and self._access.is_for_programs
        rights = self._access.rights_of(asked if is_program else token)
        reason = self._why_not(scope) or ("" if rights else self._no_token())
        if reason:
            await self._refuse(kind, reason, receive, send)
            return
        scope.setdefault("state", {})["rights"] = rights

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS]
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _why_not(self, scope: Scope) -> str:
        """Return why a request is refused whatever its token is; empty if it is not."""
        access = self._access
        hosts, origins = _header(scope, b"host"), _header(scope, b"origin")
        if hosts != [access.netloc]:
            return f"This server is at {access.origin} only, under no other name."
        if scope["type"] == "websocket" and not access.is_for_programs and origins != [access.origin]:
            return "A connection must come from a page of this server."
        if origins not in ([], [access.origin]):
            return "A request must come from a page of this server."
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return "Pages are read only; a machine is changed through their connection."
        return ""

    def _token(self, scope: Scope) -> tuple[str, str]:
        """Return the token of the cookie, and that of the address."""
        cookies = SimpleCookie()
        for text in _header(scope, b"cookie"):
            try:
                cookies.load(text)
            except CookieError:
                continue
        found = cookies.get(self._access.cookie)
        query = dict(parse_qsl(scope.get("query_string", b"").decode("latin-1"), max_num_fields=100))
        return ("" if found is None else found.value), query.get("token") or query.get("read") or ""

    def _no_token(self) -> str:
        return (
            "The address lacks the token, or it is of another run. Open the address that the program has printed: "
            f"{self._access.origin}/?token=..."
        )

    async def _keep_token(self, scope: Scope, send: SendMessage, token: str) -> None:
        """Answer with the token in a cookie, and with the address without it."""
        cookie = f"{self._access.cookie}={token}; Path=/; HttpOnly; SameSite=Strict"
        path = "/" + scope["path"].lstrip("/")  # two slashes would begin the name of another host
        headers = [(b"location", _quoted(path)), (b"set-cookie", cookie.encode()), *HEADERS]
        await _answer(send, 303, headers, b"")

    async def _refuse(self, kind: str, reason: str, receive: Receive, send: SendMessage) -> None:
        if kind == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": reason})  # before it is accepted: 403
            return
        headers = [(b"content-type", b"text/plain; charset=utf-8"), *HEADERS]
        await _answer(send, 403, headers, f"{reason}\n".encode())


async def _answer(send: SendMessage, status: int, headers: Iterable[tuple[bytes, bytes]], body: bytes) -> None:
    sized = [*headers, (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": sized})
    await send({"type": "http.response.body", "body": body})


def _header(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key.lower() == name]


def _quoted(path: str) -> bytes:
    return quote(path, safe="/._-").encode()
