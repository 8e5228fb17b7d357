"""Rate of greetings: a few per address; a client that connects repeatedly does not displace others."""

from __future__ import annotations

import pytest

from snr_sim.links import tcp_server
from snr_sim.links.newcomers import GREETINGS_AT_ONCE, GREETINGS_PER_S, MAX_ADDRESSES, MAX_KNOWN, Newcomers
from snr_sim.links.session import MAX_WAITING_BYTES
from snr_sim.links.tcp_server import MAX_NEWCOMERS

from .test_fairness import OTHER, PING, Arena, Far
from .test_fairness import Newcomers as Attackers

ATTACKER, HONEST = "192.0.2.1", "192.0.2.2"


def greetings(newcomers: Newcomers, address: str, time_s: float = 0.0) -> int:
    return sum(newcomers.may_greet(address, time_s) for _ in range(1000))


def test_address_gets_a_burst_of_greetings_and_then_a_limited_rate() -> None:
    newcomers = Newcomers()
    assert greetings(newcomers, ATTACKER) == GREETINGS_AT_ONCE
    assert greetings(newcomers, ATTACKER, 2.0) == 2 * GREETINGS_PER_S
    assert newcomers.may_greet(HONEST, 2.0)


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2", "::1", "::ffff:127.0.0.1"])
def test_greetings_from_this_machine_are_unlimited(address: str) -> None:
    assert greetings(Newcomers(), address) == 1000


def test_greetings_from_a_known_address_are_unlimited() -> None:
    newcomers = Newcomers()
    newcomers.remember(HONEST)
    assert greetings(newcomers, HONEST) == 1000


def test_ipv6_network_counts_as_one_address() -> None:
    newcomers = Newcomers()
    allowed = sum(newcomers.may_greet(f"2001:db8::{i:x}", 0.0) for i in range(1000))
    assert allowed == GREETINGS_AT_ONCE


def test_many_addresses_use_bounded_memory() -> None:
    newcomers = Newcomers()
    for i in range(5000):
        newcomers.may_greet(f"10.0.{i // 256}.{i % 256}", 0.0)
        newcomers.remember(f"10.1.{i // 256}.{i % 256}")
    assert len(newcomers._greetings) == MAX_ADDRESSES
    assert len(newcomers._known) == MAX_KNOWN


@pytest.fixture
def arena(monkeypatch: pytest.MonkeyPatch) -> Arena:
    return Arena(monkeypatch)


@pytest.mark.slow
def test_storm_from_one_address_is_closed_beyond_its_greetings(arena: Arena) -> None:
    greeted: list[str] = []
    begin = arena.link.transport._add_stream
    arena.link.transport._add_stream = lambda port, where: greeted.append(where) or begin(port, where)
    storm = Attackers(arena, lambda sock: None, address=ATTACKER)
    arena.attack(storm)
    assert storm.count > 3 * GREETINGS_AT_ONCE
    assert len(greeted) <= GREETINGS_AT_ONCE + 1 + GREETINGS_PER_S
    assert len(arena.link.transport.streams) <= 1 + GREETINGS_AT_ONCE


@pytest.mark.slow
def test_client_of_another_address_greets_while_one_fills_all_slots(arena: Arena) -> None:
    arena.link.transport._newcomers.remember(ATTACKER)  # so its greetings are not limited
    arena.fars.append(Attackers(arena, lambda sock: None, kept=1000, address=ATTACKER))
    arena.run_for(0.3)
    sock = arena.network.connect("127.0.0.1", arena.pair.port, HONEST)
    arena.run_for(0.5)  # it sends nothing, so it may be the oldest of all
    waiting = [stream.where for stream in arena.link.transport.streams if not stream.is_admitted]
    assert len(waiting) == MAX_NEWCOMERS
    assert f"{HONEST}:40000" in waiting
    sock.close()


@pytest.mark.slow
def test_address_of_an_accepted_peer_greets_without_limit(arena: Arena) -> None:
    arena.fars.append(Far(arena, list, address=HONEST))
    arena.run_for(0.1)
    assert greetings(arena.link.transport._newcomers, HONEST) == 1000
    assert greetings(arena.link.transport._newcomers, ATTACKER) < 1000


@pytest.mark.slow
def test_closing_connections_count_and_are_closed_before_silent_ones(arena: Arena) -> None:
    transport = arena.link.transport
    transport._newcomers.remember(ATTACKER)
    sock = arena.network.connect("127.0.0.1", arena.pair.port, ATTACKER)
    arena.run_for(0.1)
    silent = transport.streams[-1]
    assert not silent.is_admitted
    storm = Attackers(arena, lambda sock: sock.send(b"GET / HTTP/1.1"), kept=1000, address=ATTACKER)
    arena.fars.append(storm)
    arena.run_for(0.2)
    assert storm.count > 2 * MAX_NEWCOMERS
    assert len(transport.streams) <= 1 + MAX_NEWCOMERS
    assert silent in transport.streams
    sock.close()


@pytest.mark.slow
def test_peers_of_one_name_in_all_slots_yield_to_another_name(arena: Arena, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp_server, "MAX_PEERS", 8)  # each reconnection takes simulated, and real, time
    far: list[Far] = []
    for _ in range(8 + 5):
        far.append(Far(arena, list, "many"))
        arena.fars.append(far[-1])
        arena.run_for(0.02)
    late = Far(arena, lambda: list(OTHER), "late")
    arena.fars.append(late)
    arena.run_for(0.3)
    names = [peer.session.peer_node for peer in arena.link.transport.peers.up]
    assert len(names) <= 8
    assert names.count("pilot") == names.count("late") == 1
    assert late.comings == 1


@pytest.mark.slow
def test_non_reading_peer_is_closed_before_answers_fill_memory(arena: Arena) -> None:
    max_bytes = 0
    pump = arena.link.transport._pump

    def watch(stream: object) -> None:
        nonlocal max_bytes
        pump(stream)
        max_bytes = max(max_bytes, *(sum(map(len, one._control)) for one in arena.link.transport.streams), 0)

    arena.link.transport._pump = watch
    far = Far(arena, lambda: [PING] * 50, reads=False)
    arena.fars.append(far)
    arena.run_for(3.0)
    assert far.comings > 1
    assert max_bytes <= MAX_WAITING_BYTES + 8192
