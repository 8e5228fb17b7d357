"""Options of a ZenohNet: addresses, certificates, names. None of it needs Zenoh."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import Tls, ZenohNet
from snr_sim.prelude.errors import ConfigError

HERE = "tcp/127.0.0.1:7447"


@pytest.mark.parametrize("address", ["tcp/192.168.2.1:7447", "tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/robot.local:1"])
@pytest.mark.parametrize("where", ["listen", "connect"])
def test_remote_address_without_certificates_raises_config_error(where: str, address: str) -> None:
    with pytest.raises(ConfigError, match=rf"{where}= holds(.|\n)*any computer in that network(.|\n)*tls=Tls"):
        ZenohNet(**{where: address})


@pytest.mark.parametrize("address", ["127.0.0.1:7447", "udp/127.0.0.1:7447", "tcp/127.0.0.1", "tcp/h:99999", "", 7447])
def test_invalid_address_raises_config_error_with_fix(address: Any) -> None:
    with pytest.raises(ConfigError, match=r"which is not an address(.|\n)*tcp/127\.0\.0\.1:7447"):
        ZenohNet(listen=[address])


def test_loopback_address_needs_no_certificates() -> None:
    for address in (HERE, "tcp/localhost:7447", "tcp/[::1]:7447"):
        assert ZenohNet(listen=address).listen[0] == address


def test_node_without_any_address_raises_config_error() -> None:
    with pytest.raises(ConfigError, match="neither listens nor connects"):
        ZenohNet(name="fleet").link("x")


def test_missing_certificates_raise_config_error_with_their_names(files: dict[str, str]) -> None:
    address = "tls/192.168.2.1:7447"
    authority, shown = files["authority"], {"certificate": files["robot_cert"], "key": files["robot_key"]}
    with pytest.raises(ConfigError, match="there is no tls="):
        ZenohNet(listen=address)
    with pytest.raises(ConfigError, match="needs the authority"):
        ZenohNet(listen=address, tls=Tls(**shown)).link()
    with pytest.raises(ConfigError, match="needs a certificate"):
        ZenohNet(connect=address, tls=Tls(authority=authority)).link()
    with pytest.raises(ConfigError, match="cannot use its files"):
        ZenohNet(listen=address, tls=Tls("none.pem", "none.pem", client_authority=authority)).link()
    student = {"client_certificate": files["student_cert"], "client_key": files["student_key"]}
    both = Tls(**shown, **student, authority=files["other_authority"], client_authority=authority)
    with pytest.raises(ConfigError, match="two authorities"):
        ZenohNet(listen=address, connect=address, tls=both).link()
    with pytest.raises(ConfigError, match="server_name='robot'"):
        ZenohNet(connect=address, tls=Tls(**student, authority=authority, server_name="robot")).link()


def test_remote_discovery_without_certificates_raises_config_error() -> None:
    with pytest.raises(ConfigError, match=r"discover=True on lo, wlan0 needs TLS(.|\n)*interfaces="):
        ZenohNet(discover=True, interfaces=["lo", "wlan0"]).link()


def test_net_opens_only_the_given_addresses(files: dict[str, str]) -> None:
    config = ZenohNet(name="fleet", listen=HERE).link().config()
    assert config["listen"]["endpoints"] == [HERE]
    assert config["connect"]["endpoints"] == []
    assert config["scouting"]["multicast"]["enabled"] is False
    assert config["scouting"]["gossip"]["enabled"] is False
    assert config["transport"]["link"]["protocols"] == ["tcp"]
    access = config["access_control"]
    assert (access["enabled"], access["default_permission"]) == (True, "deny")
    assert [rule["key_exprs"] for rule in access["rules"]] == [["snr/fleet/**"]]
    student = {"client_certificate": files["student_cert"], "client_key": files["student_key"]}
    tls = Tls(authority=files["authority"], **student)
    abroad = ZenohNet(discover=True, interfaces=["wlan0"], tls=tls).link().config()
    assert abroad["transport"]["link"]["protocols"] == ["tls"]
    assert abroad["transport"]["link"]["tls"]["enable_mtls"] is True


@pytest.mark.parametrize("name", ["", "x" * 300, 7])
def test_net_without_name_raises_config_error(name: Any) -> None:
    with pytest.raises(ConfigError, match="is not a valid name of a net"):
        ZenohNet(name=name)
