"""Byte formats of devices: framing, encoding and decoding, and the ports and buses that carry them."""
