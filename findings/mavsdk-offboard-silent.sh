#!/usr/bin/env bash
# MAVSDK 4.1.0 (Python): once the vehicle has been out of OFFBOARD for about a second, the library stops repeating the setpoint, raises nothing, and does not begin again when the pilot
# switches back to OFFBOARD: the vehicle is then in OFFBOARD without setpoints. Loss of all heartbeats has no such effect: the library goes on at 20 Hz and says that offboard is active.
# `is_active` is true as well before `start`, with the vehicle in HOLD.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install mavsdk==4.1.0 pymavlink==2.4.50
"$folder/v/bin/python" - <<'PYTHON' 2>&1 | sed '/_impl.cpp\|_connection.cpp/d'
import asyncio
import os
import socket
import threading
import time

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.offboard import Attitude, OffboardAsync
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as wire

HOLD, OFFBOARD, SET_MODE = (4, 3), (6, 0), wire.MAV_CMD_DO_SET_MODE
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    PORT = free.getsockname()[1]

class Vehicle(threading.Thread):
    """A fixed wing with PX4's modes: sends heartbeats, obeys DO_SET_MODE, counts setpoints."""

    def __init__(self):
        super().__init__(daemon=True)
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{PORT}", source_system=1, source_component=1, dialect="common")
        self.mode, self.silent, self.setpoints = HOLD, False, 0

    def run(self):
        beat = 0.0
        while True:
            if time.monotonic() - beat > 0.25 and not self.silent:
                beat = time.monotonic()
                mode = self.mode[0] << 16 | self.mode[1] << 24
                self.link.mav.heartbeat_send(wire.MAV_TYPE_FIXED_WING, wire.MAV_AUTOPILOT_PX4, 209, mode, wire.MAV_STATE_ACTIVE)
            message = self.link.recv_match(blocking=True, timeout=0.02)
            kind = message.get_type() if message else ""
            self.setpoints += kind == "SET_ATTITUDE_TARGET"
            if kind == "COMMAND_LONG":
                if message.command == SET_MODE:
                    self.mode = int(message.param2), int(message.param3)
                self.link.mav.command_ack_send(message.command, 0)

async def main():
    vehicle = Vehicle()
    vehicle.start()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(f"udpin://127.0.0.1:{PORT}")
    offboard = OffboardAsync(await mavsdk.first_autopilot(10.0))
    rows = {}

    async def seen(what, seconds=2.0):
        before = vehicle.setpoints
        await asyncio.sleep(seconds)
        rows[what] = (vehicle.setpoints - before) / seconds, await offboard.is_active()
        print(f"{what:44} {rows[what][0]:5.1f} setpoints a second, is_active {rows[what][1]}")

    await offboard.set_attitude(Attitude(10.0, 5.0, 0.0, 0.5))
    await seen("setpoint set, not started")
    await offboard.start()
    await seen("started, vehicle in OFFBOARD")
    vehicle.mode = HOLD
    await asyncio.sleep(2.0)
    await seen("pilot has switched to HOLD")
    vehicle.mode = OFFBOARD
    await seen("pilot has switched back to OFFBOARD", 4.0)
    await offboard.set_attitude(Attitude(10.0, 5.0, 0.0, 0.5))
    await offboard.start()
    await seen("set and started again")
    vehicle.silent = True
    await asyncio.sleep(6.0)
    await seen("no heartbeat for 6 to 8 s")
    near = lambda what: 17 < rows[what][0] < 23
    assert all(near(k) for k in list(rows) if "pilot" not in k)
    assert rows["pilot has switched to HOLD"][0] == 0 and rows["pilot has switched back to OFFBOARD"] == (0, False)
    assert rows["no heartbeat for 6 to 8 s"][1] and rows["setpoint set, not started"][1]

asyncio.run(main())
print("MAVSDK 4.1.0, pymavlink 2.4.50", flush=True)
os._exit(0)
PYTHON
