"""Access control of a node: secrets, addresses, certificates; first their messages, then over real sockets."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from snr_sim import CommandReceiverFactory, SocketsPair, Tls, secret_from_env, secret_from_file
from snr_sim.links.faults import LinkFaults
from snr_sim.links.messages import RefusedMessage
from snr_sim.links.security import as_networks, is_allowed, is_loopback
from snr_sim.prelude.errors import ConfigError

HERE = "127.0.0.1"
Start = Callable[..., Any]


def test_short_secret_raises_config_error_with_fix() -> None:
    with pytest.raises(ConfigError, match=r"has 6 bytes, but needs at least 16(.|\n)*token_hex"):
        SocketsPair((HERE, 0), secret="secret")


@pytest.mark.parametrize("secret", [20, [0] * 16, 1234567890123456789, True, bytearray(16), Path("secret")])
def test_secret_of_another_type_raises_config_error(secret: Any) -> None:
    with pytest.raises(ConfigError, match=f"secret=.* is of type {type(secret).__name__}"):
        SocketsPair((HERE, 0), secret=secret)
    with pytest.raises(ConfigError, match=f"token=.* is of type {type(secret).__name__}"):
        CommandReceiverFactory(0, token=secret)


def test_secret_that_utf8_cannot_encode_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"\(secret=\) is not valid UTF-8 text: half a character at index 4"):
        SocketsPair((HERE, 0), secret="good\ud800 and sixteen or more")


@pytest.mark.parametrize("allow", [None, 5, b"1234", [1], [b"1234"]])
def test_invalid_address_in_allow_raises_config_error(allow: Any) -> None:
    with pytest.raises(ConfigError, match=r"allow(.|\n)*Try: \[\"192"):
        SocketsPair((HERE, 0), allow=allow)


def test_non_path_certificate_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"Tls certificate is 5\.(.|\n)*Try: use the path of a PEM file"):
        Tls(5, 6)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"Tls server_name is None"):
        Tls(server_name=None)  # type: ignore[arg-type]


def test_secret_is_read_from_a_file_or_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "secret").write_text("0123456789abcdef\n")
    assert secret_from_file(tmp_path / "secret") == b"0123456789abcdef"
    monkeypatch.setenv("SNR_SECRET", "fedcba9876543210")
    assert secret_from_env("SNR_SECRET") == b"fedcba9876543210"
    with pytest.raises(ConfigError, match="cannot be read"):
        secret_from_file(tmp_path / "none")
    with pytest.raises(ConfigError, match="NO_SUCH_SECRET should hold"):
        secret_from_env("NO_SUCH_SECRET")


def test_only_this_machine_and_named_networks_are_allowed() -> None:
    networks = as_networks(["10.1.0.0/16", "192.168.2.7"])
    allowed = {
        "127.0.0.1": True,
        "::1": True,
        "::ffff:127.0.0.1": True,
        "10.1.200.3": True,
        "::ffff:10.1.200.3": True,
        "192.168.2.7": True,
        "192.168.2.8": False,
        "fe80::1%eth0": False,
        "nonsense": False,
    }
    assert {address: is_allowed(address, networks) for address in allowed} == allowed
    assert is_loopback("localhost")
    assert not is_loopback("robot.local")
    with pytest.raises(ConfigError, match=r"'10\.1\.\*'"):
        as_networks(["10.1.*"])


@pytest.fixture
def tls(files: dict[str, str]) -> Tls:
    """Return the certificates of a server, and the authority that a client trusts."""
    return Tls(files["robot_cert"], files["robot_key"], files["authority"])


@pytest.mark.slow
def test_address_not_in_allow_is_refused_before_its_greeting(
    start: Start, raw: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Every peer of a test connects from this machine, so the rule itself is replaced to reject it.
    monkeypatch.setattr("snr_sim.links.tcp_server.is_allowed", lambda address, networks: False)
    pair = SocketsPair((HERE, 0), name="t")
    robot = start("robot", [pair.server()], down="t")
    last = raw(pair.port).messages(until=RefusedMessage)[-1]
    assert "127.0.0.1 may not connect to node 'robot_node'" in last.reason
    assert robot.stored["link_t"][-1]["up"] is False


@pytest.mark.slow
def test_wrong_secret_is_reported_at_both_ends(start: Start) -> None:
    pair = SocketsPair((HERE, 0), name="t", secret="the right secret of this robot")
    robot = start("robot", [pair.server()], down="t")
    wrong = SocketsPair((HERE, pair.port), name="t", secret="the wrong secret of this robot")
    intruder = start("intruder", [wrong.client("x")])
    intruder.store("x", "evil")
    intruder.until_link("t", up=False)
    intruder.until(lambda: "secrets of the two ends differ" in intruder.stored["link_t"][-1]["reason"], "refused")
    none = start("none", [SocketsPair((HERE, pair.port), name="t").client("x")])
    none.until(lambda: none.stored["link_t"] and "asks for a shared" in none.stored["link_t"][-1]["reason"], "refused")
    honest = start("honest", [SocketsPair((HERE, pair.port), name="t", secret=pair.secret).client("x")], up="t")
    honest.store("x", "good")
    assert robot.until_stored("x") == ["good"]


@pytest.mark.slow
def test_wrong_secret_is_reported_over_a_delayed_link(start: Start) -> None:
    late = LinkFaults(latency_s=0.02)
    pair = SocketsPair((HERE, 0), name="t", secret="the right secret of this robot", faults=late)
    start("robot", [pair.server()], down="t")
    wrong = SocketsPair((HERE, pair.port), name="t", secret="the wrong secret of this robot", faults=late)
    intruder = start("intruder", [wrong.client("x")], down="t")
    intruder.until(lambda: "secrets of the two ends differ" in intruder.stored["link_t"][-1]["reason"], "refused")


@pytest.mark.slow
def test_waiting_page_is_sent_only_to_an_authenticated_client(start: Start) -> None:
    pair = SocketsPair((HERE, 0), name="t", secret="the right secret of this robot")
    robot = start("robot", [pair.server("depth")], down="t")
    robot.store("depth", 1.5)
    robot.until_stored("depth")
    topside = start("topside", [pair.client()])
    assert topside.until_stored("depth") == [1.5]
    assert [state["reason"] for state in topside.stored["link_t"] if "came" in state["reason"]] == []


@pytest.mark.slow
def test_tls_carries_large_and_small_pages_in_both_directions(start: Start, tls: Tls) -> None:
    pair = SocketsPair((HERE, 0), name="t", tls=tls, max_frame_bytes=1 << 23)
    robot = start("robot", [pair.server("photo")], down="t")
    client = start("client", [pair.client("x")], up="t")
    robot.until_link("t")
    robot.store("photo", "y" * 3_000_000)
    for value in range(2000):
        client.store("x", value)
    assert robot.until_stored("x", 2000) == list(range(2000))
    assert client.until_stored("photo") == ["y" * 3_000_000]


@pytest.mark.slow
def test_unsigned_server_receives_no_data(start: Start, files: dict[str, str]) -> None:
    tls = Tls(files["robot_cert"], files["robot_key"], files["other_authority"])
    pair = SocketsPair((HERE, 0), name="t", tls=tls)
    robot = start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")], down="t")
    client.until(lambda: "certificate verify failed" in client.stored["link_t"][-1]["reason"], "reason")
    assert robot.thread.is_alive()


@pytest.mark.slow
@pytest.mark.parametrize("has_it", ["server", "client"])
def test_tls_on_one_end_only_is_reported_with_fix(start: Start, tls: Tls, has_it: str) -> None:
    pair = SocketsPair((HERE, 0), name="t", tls=tls if has_it == "server" else None)
    robot = start("robot", [pair.server()], down="t")
    there = SocketsPair((HERE, pair.port), name="t", tls=tls if has_it == "client" else None)
    client = start("client", [there.client("x")])

    def until_reason(end: Any, words: str) -> None:
        end.until(lambda: any(words in state["reason"] for state in end.stored["link_t"]), words)

    fix = "Try: tls=Tls(...) on both ends"
    until_reason(robot if has_it == "server" else client, f"this end speaks TLS, the other does not. {fix} (")
    if has_it == "client":  # a server with TLS sends nothing to a client without TLS
        until_reason(robot, f"The other end speaks TLS, this one does not. {fix}.")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("which", "words"),
    [
        ("expired", "the other end's certificate has expired. Try: "),
        ("elsewhere", "is for another address. Try: Tls(server_name="),
        ("named", "is for another name. Try: Tls(server_name="),
    ],
)
def test_invalid_certificate_is_reported_with_fix(start: Start, tmp_path: Path, which: str, words: str) -> None:
    trustme = pytest.importorskip("trustme")
    authority = trustme.CA()
    yesterday = datetime.now(UTC) - timedelta(days=1)
    cert = {
        "expired": lambda: authority.issue_cert(HERE, not_after=yesterday),
        "elsewhere": lambda: authority.issue_cert("10.0.0.7"),
        "named": lambda: authority.issue_cert(HERE),
    }[which]()
    paths = [str(tmp_path / name) for name in ("cert", "key", "authority")]
    for path, blob in zip(paths, (cert.cert_chain_pems[0], cert.private_key_pem, authority.cert_pem), strict=True):
        blob.write_to_path(path)
    tls = Tls(*paths, server_name="robot.example" if which == "named" else "")
    pair = SocketsPair((HERE, 0), name="t", tls=tls)
    start("robot", [pair.server()], down="t")
    client = start("client", [pair.client()])
    client.until(lambda: any(words in state["reason"] for state in client.stored["link_t"]), words)
    assert "([SSL: CERTIFICATE_VERIFY_FAILED]" in client.stored["link_t"][-1]["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("who", ["student", "evil", "uncertified"])
def test_only_clients_signed_by_the_authority_are_accepted(start: Start, files: dict[str, str], who: str) -> None:
    server = Tls(files["robot_cert"], files["robot_key"], client_authority=files["authority"])
    pair = SocketsPair((HERE, 0), name="t", tls=server)
    robot = start("robot", [pair.server()], down="t")
    own = (
        {} if who == "uncertified" else {"client_certificate": files[f"{who}_cert"], "client_key": files[f"{who}_key"]}
    )
    there = SocketsPair((HERE, pair.port), name="t", tls=Tls(authority=files["authority"], **own))
    client = start("client", [there.client("x")])
    client.store("x", who)
    if who == "student":
        assert robot.until_stored("x") == ["student"]
        return
    words = {
        "evil": "is not signed by the authority this end trusts. Try: ",
        "uncertified": "the client shows no certificate. Try: ",
    }
    robot.until(lambda: words[who] in robot.stored["link_t"][-1]["reason"], "reason")
    assert not robot.stored["x"]


@pytest.mark.slow
def test_client_without_tls_is_refused_and_others_connect(start: Start, tls: Tls, raw: Callable[..., Any]) -> None:
    pair = SocketsPair((HERE, 0), name="t", tls=tls)
    start("robot", [pair.server()], down="t")
    assert raw(pair.port).sock.recv(100)[:1] in (b"\x15", b"")  # an alert of TLS, or the end of the stream
    start("client", [pair.client("x")], up="t")


def test_unusable_certificates_raise_config_error_at_construction(files: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match=r"cannot use its files \(/nowhere\.pem"):
        SocketsPair((HERE, 0), tls=Tls("/nowhere.pem", files["robot_key"])).server()
    with pytest.raises(ConfigError, match="cannot use its files"):
        SocketsPair((HERE, 0), tls=Tls(files["robot_cert"], files["student_key"])).server()
    with pytest.raises(ConfigError, match="needs a certificate"):
        SocketsPair((HERE, 0), tls=Tls(authority=files["authority"])).server()
    with pytest.raises(ConfigError, match="needs the authority"):
        SocketsPair((HERE, 0), tls=Tls(files["robot_cert"], files["robot_key"])).client()
