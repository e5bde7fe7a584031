#!/usr/bin/env bash
# node-mavlink 2.3.0 (npm), its splitter for telemetry logs with Node's file stream: createReadStream() hands a file on in pieces of 64 KiB, and of the messages that lie across a border some are lost. The splitter cuts off the time that
# precedes a message as soon as it has found its first byte. If the rest is in the next piece it waits for it, and then searches again for a first byte with eight bytes of time before it, which this message has no more.
# Of the package's own sample log 7 of 23894 messages are missing, at 14 borders; in pieces of 1 KiB, as a pipe or a socket may give them, 1100; in one piece none, and pymavlink reads as many. Nothing is thrown; the splitter counts one
# message as invalid. The sequence numbers that are missing grow by the same 7 and 1100.
# Why it matters: that is how a radio link looks that loses messages, so that its loss is measured too high, at a rate that depends on how the file was read; and of a list of parameters, a mission, or the few changes of mode the one at the
# border is missing, from a log that has it.
# The package's example is written for just this. Its splitter for links, MavLinkPacketSplitter, loses nothing at borders, but on a log takes bytes of the times for messages. Instead: createReadStream(name, { highWaterMark: more than the
# file has }), or pymavlink.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder" && npm init -y > /dev/null && npm install --silent --no-audit --no-fund node-mavlink@2.3.0 mavlink-mappings@1.0.21-20250824-1
python3 -m venv v && v/bin/pip -q install --no-compile pymavlink==2.4.50
v/bin/python - node_modules/node-mavlink/examples/vtol.tlog > pymavlink.txt <<'PYTHON'
import os, sys
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
log = mavutil.mavlink_connection(sys.argv[1])
print(sum(1 for message in iter(log.recv_msg, None) if message.get_type() != "BAD_DATA"))
PYTHON
cat > read.js <<'JS'
const assert = require("assert"), { createReadStream, readFileSync, statSync } = require("fs");
const { MavLinkTLogPacketSplitter, MavLinkPacketParser } = require("node-mavlink");
const name = "node_modules/node-mavlink/examples/vtol.tlog", size = statSync(name).size;
const read = (options) => new Promise((done) => {
  const splitter = new MavLinkTLogPacketSplitter(), messages = [];
  createReadStream(name, options).pipe(splitter).pipe(new MavLinkPacketParser())
    .on("data", (p) => messages.push({ id: `${p.header.timestamp} ${p.buffer.toString("hex")}`, sender: `${p.header.sysid}/${p.header.compid}`, seq: p.header.seq, type: p.header.msgid }))
    .on("end", () => done({ messages, invalid: splitter.invalidPackages, unknown: splitter.unknownPackagesCount }));
});
const gaps = (messages) => {
  const last = {};
  return messages.reduce((sum, { sender, seq }) => { const jump = sender in last ? (seq - last[sender] + 255) % 256 : 0; last[sender] = seq; return sum + jump; }, 0);
};
(async () => {
  const known = Number(readFileSync("pymavlink.txt")), whole = await read({ highWaterMark: size + 1 }), plain = await read(), small = await read({ highWaterMark: 1024 });
  console.log(`node-mavlink ${require("node-mavlink/package.json").version}, its sample log of ${size} bytes; pymavlink reads ${known} messages`);
  for (const [label, { messages, invalid, unknown }] of [["in one piece", whole], ["createReadStream(name)", plain], ["pieces of 1 KiB", small]])
    console.log(`${label.padEnd(22)} ${messages.length} messages, ${gaps(messages)} sequence numbers missing; it counts ${invalid} invalid, ${unknown} unknown`);
  const have = new Set(plain.messages.map((m) => m.id)), lost = whole.messages.filter((m) => !have.has(m.id));
  console.log(`lost at ${Math.floor(size / 65536)} borders: message types ${lost.map((m) => m.type).join(", ")}`);
  assert(whole.messages.length === known && plain.messages.length === known - 7 && lost.length === 7);
  assert(small.messages.length === known - 1100 && gaps(plain.messages) === gaps(whole.messages) + 7 && gaps(small.messages) === gaps(whole.messages) + 1100);
  assert(plain.invalid + plain.unknown === 1);
})();
JS
node read.js
