#!/usr/bin/env python3
"""Reads an MCAP file with readers that were made elsewhere, and decodes every message in it.

    python independent_reader.py FILE

Needs the PyPI packages mcap and mcap-ros2-support. Prints one JSON document:

    {"profile": …, "messages": N, "metadata": {NAME: {…}}, "attachments": {NAME: TEXT},
     "topics": [{"topic", "type", "count", "first_s", "last_s", "first": {field: value}}]}

Long rows in "first" are cut to their first eight values; what is no finite number is null. Ends with 1 if a message cannot be decoded.
"""

import json
import math
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def plain(value, most=8):
    """A decoded message as numbers, texts, lists and tables."""
    if isinstance(value, float) and not math.isfinite(value):
        return None  # JSON has no word for it
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (bytes, bytearray, memoryview)):
        return list(bytes(value)[:most])
    if hasattr(value, "tolist"):
        return plain(value.tolist(), most)
    if isinstance(value, (list, tuple)):
        return [plain(entry, most) for entry in value[:most]]
    return {name: plain(getattr(value, name), most) for name in value.__slots__}


def main(path):
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        profile = reader.get_header().profile
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = topics.setdefault(
                channel.topic,
                {
                    "topic": channel.topic,
                    "type": schema.name,
                    "count": 0,
                    "first_s": message.log_time * 1e-9,
                    "last_s": message.log_time * 1e-9,
                    "first": plain(decoded),
                },
            )
            topic["count"] += 1
            topic["last_s"] = message.log_time * 1e-9
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        attachments = {record.name: record.data.decode() for record in reader.iter_attachments()}
        counted = reader.get_summary().statistics.message_count
    report = {
        "profile": profile,
        "messages": sum(topic["count"] for topic in topics.values()),
        "metadata": metadata,
        "attachments": attachments,
        "topics": sorted(topics.values(), key=lambda topic: topic["topic"]),
    }
    print(json.dumps(report, indent=1))
    if report["messages"] != counted:
        sys.exit(f"{path}: the index counts {counted} messages, {report['messages']} could be read")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
