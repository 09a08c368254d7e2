#!/usr/bin/env bash
# One would guess: AnyReader lists the connections that it can decode and leaves the others of an MCAP file to its
# caller.
#
# What happens: one channel whose schema is no ROS message (JSON, as Foxglove and many recorders write next to ROS 2
# topics) ends open() with KeyError: 'jsonschema'. No topic of the file can be read.
#
# Why it matters: a flight recorded with a note or a parameter dump in the same file looks like a broken file, and the
# error names neither channel nor reason.
#
# Output seen:
#   rosbags 0.11.9 mcap 1.3.1
#   ROS messages: 10 messages read
#   the same and one of JSON: KeyError('jsonschema')
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check rosbags==0.11.9 mcap==1.3.1
env/bin/python - <<'END'
from importlib.metadata import version
from pathlib import Path

from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

store, kind = get_typestore(Stores.ROS2_HUMBLE), "std_msgs/msg/Float64"
definition, _ = store.generate_msgdef(kind)


def record(path, note):
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        thrust = writer.register_channel("/thrust", "cdr", writer.register_schema(kind, "ros2msg", definition.encode()))
        for k in range(10):
            writer.add_message(thrust, k, bytes(store.serialize_cdr(store.types[kind](float(k)), kind)), k)
        if note:
            channel = writer.register_channel("/note", "json", writer.register_schema("note", "jsonschema", b"{}"))
            writer.add_message(channel, 10, b"{}", 10)
        writer.finish()


print("rosbags", version("rosbags"), "mcap", version("mcap"))
for name, note in (("ROS messages", False), ("the same and one of JSON", True)):
    record("log.mcap", note)
    try:
        with AnyReader([Path("log.mcap")]) as reader:
            said = f"{len(list(reader.messages()))} messages read"
    except Exception as error:
        said = repr(error)
    print(f"{name}: {said}")
assert said == "KeyError('jsonschema')", "a channel that is no ROS message is read otherwise now"
END
