"""Reads traces and talks to nodes with Python's standard library alone, written from docs/formats.md. Knows no kit.

plain_client.py trace FILE [KEY]                    checks order and digest, prints the history of a page
plain_client.py link HOST PORT SECRET PAGES KEY DATA   sends a page of KEY, prints the first PAGES that come
"""

import base64
import collections
import hashlib
import hmac
import json
import math
import os
import pathlib
import socket
import struct
import sys

SIMPLE = {"float": float, "tuple": tuple, "dict": dict}
SIMPLE["int"] = lambda v: int(v, 16)
SIMPLE["bytes"] = lambda v: base64.b64decode(v, validate=True)
INTEGERS = ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
FLOATS = ("float16", "float32", "float64")
LETTERS = dict(zip((*INTEGERS, *FLOATS), "?bhiqBHIQefd", strict=True))


def value(fields):
    """Brings back an object of JSON: json.loads calls it for each, the inner ones first."""
    mark = fields.get("$")
    if mark == "dict" and max(collections.Counter(hash(key) for key, _ in fields["v"]).values(), default=0) > 64:
        sys.exit("more than 64 keys of a dict have the same hash")
    if mark in SIMPLE:
        return SIMPLE[mark](fields["v"])
    if mark == "array" and "b64" in fields:  # flat; the shape is in a field of its own
        form = f"<{math.prod(fields['shape'])}{LETTERS[fields['dtype']]}"
        return {"shape": fields["shape"], "flat": struct.unpack(form, base64.b64decode(fields["b64"]))}
    return fields["data"] if mark == "array" else fields


def load(line):
    return json.loads(line, object_hook=value, parse_constant=lambda word: sys.exit(f"{word} is not JSON"))


def trace(file, key=None):
    data = pathlib.Path(file).read_bytes()
    whole = data[: data.rindex(b"\n", 0, (data + b"\0").index(b"\0")) + 1]
    opening, header, *records = [load(line) for line in whole.split(b"\n")[:-1]]
    if opening["kind"] != "trace" or opening["schema"] != 3 or header["kind"] != "header":
        sys.exit(f"no trace of format 3: {opening}")
    print("digest", hashlib.blake2b(whole[whole.index(b"\n") + 1 :], digest_size=32).hexdigest())
    print("cut" if len(whole) < len(data) else "whole", len(records))
    brought = {}  # by seq and nth: time and task
    for seq, record in enumerate(records, 1):
        kind, place = record["kind"], (record.get("cause"), record.get("index", 0))
        if record["seq"] != seq or (kind in ("task", "page", "repeat") and place not in brought):
            sys.exit("a record is missing or moved")
        t, task = brought.get(place, (None, [record.get(name) for name in ("type", "name", "values")]))
        tasks = [task] if kind in ("input", "repeat") else record.get("returned", [])
        if kind == "page" and record.get("process", True):
            tasks = [["process_data", task[1], task[2]]]
        tasks += [one for by in record.get("handled", []) for one in by[2]]
        brought.update(((seq, index), (record.get("t", t), one)) for index, one in enumerate(tasks))
        if kind == "page" and task[1] == key:
            print(record.get("t", t), task[2][0]["created_at_s"], repr(task[2][0]["data"]))


def frame(payload):
    return len(payload).to_bytes(4, "big") + payload


def mac(key, number, message):
    data = number.to_bytes(8, "big") + frame(message)
    return hashlib.blake2b(data, key=key, digest_size=16).digest()


def link(host, port, secret, pages, page, data):
    sock = socket.create_connection((host, int(port)), timeout=30)
    stream = sock.makefile("rb")
    nonce, name = os.urandom(16).hex(), "plain_node"
    crossed = {"out": [], "in": []}  # payloads so far; the first two of each direction have no MAC

    def key(use):
        text = f"snr 2 {use}\0".encode() + frame(crossed["out"][0]) + frame(crossed["in"][0])
        return hmac.digest(secret.encode(), text, "sha256")

    def send(**message):
        payload = json.dumps({"$" if name == "mark" else name: item for name, item in message.items()}).encode()
        if secret and len(crossed["out"]) > 1:
            payload += mac(key("client frames"), len(crossed["out"]) - 2, payload)
        crossed["out"].append(payload)
        sock.sendall(frame(payload))

    def receive():
        header = stream.read(4)
        payload = stream.read(int.from_bytes(header, "big"))
        crossed["in"].append(payload)
        if secret and len(crossed["in"]) > 2 and len(header) == 4:
            payload, found = payload[:-16], payload[-16:]
            if not hmac.compare_digest(found, mac(key("server frames"), len(crossed["in"]) - 3, payload)):
                sys.exit("something between us changes frames")
        return load(payload) if len(header) == 4 else {"$": "gone"}

    about = {"protocol": "snr", "version": 2, "node": name, "nonce": nonce, "purpose": "pages"}
    send(mark="hello", **about, auth=bool(secret), max_frame_bytes=1 << 20)
    hello = message = receive()
    if secret and hello["$"] == "hello":
        send(mark="auth", proof=key("client proof").hex())
        message = receive()
        if message["$"] == "auth" and not hmac.compare_digest(message["proof"], key("server proof").hex()):
            sys.exit("that is not the server")
    if message["$"] in ("hello", "auth"):
        print("up", hello["node"], flush=True)
        send(mark="page", key=page, data=json.loads(data), origin=name, created_at_s=0.0, process=True)
    left = int(pages)
    while left and message["$"] not in ("bye", "refused", "gone"):
        message = receive()
        if message["$"] == "ping":
            send(mark="pong", stamp_s=message["stamp_s"])
        elif message["$"] == "page":
            left -= 1
            print("page", message["key"], message["origin"], repr(message["data"]), flush=True)
    print(message["$"], message.get("reason", ""), flush=True)
    if not left:
        send(mark="bye", reason="that was all.")


if __name__ == "__main__":
    {"trace": trace, "link": link}[sys.argv[1]](*sys.argv[2:])
