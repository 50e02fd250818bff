"""Packets in and out: UDP and TCP, codec, announces, what is dropped. Nothing of any vehicle's state."""
