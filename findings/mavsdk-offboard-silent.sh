#!/usr/bin/env bash
# MAVSDK 4.1.0 (Python) stops repeating the offboard setpoint, without an error, once it has not read OFFBOARD for one to three seconds, and does not begin again with the mode: a pilot who
# takes over and gives back leaves the vehicle in OFFBOARD without setpoints. A plane of ArduPilot always meets this: `start()` asks for GUIDED and succeeds, but a plane's GUIDED reads UNKNOWN
# (so do FBWA, FBWB and CRUISE), a copter's reads OFFBOARD. When all heartbeats are lost it goes on at 20 Hz, and `is_active` is true, as it is before `start()`.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install mavsdk==4.1.0 pymavlink==2.4.50
cat > "$folder/beside.py" <<'PYTHON'
import asyncio
import os
import socket
import sys
import threading
import time

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.offboard import Attitude, OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.telemetry import FlightMode
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as wire

px4 = lambda main, sub=0: main << 16 | sub << 24
ARDUPILOT = wire.MAV_AUTOPILOT_ARDUPILOTMEGA
WHO, (AUTOPILOT, KIND, HOLD, OFFBOARD) = sys.argv[1], {
    "PX4": (wire.MAV_AUTOPILOT_PX4, wire.MAV_TYPE_FIXED_WING, px4(4, 3), px4(6)),
    "ArduPlane": (ARDUPILOT, wire.MAV_TYPE_FIXED_WING, 12, 15),
    "ArduCopter": (ARDUPILOT, wire.MAV_TYPE_QUADROTOR, 5, 4),
}[sys.argv[1]]
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    PORT = free.getsockname()[1]

class Vehicle(threading.Thread):
    """Sends heartbeats, obeys DO_SET_MODE, counts setpoints."""

    def __init__(self):
        super().__init__(daemon=True)
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{PORT}", source_system=1, source_component=1, dialect="ardupilotmega")
        self.mode, self.silent, self.setpoints = HOLD, False, 0

    def run(self):
        beat = 0.0
        while True:
            if time.monotonic() - beat > 0.2 and not self.silent:
                beat = time.monotonic()
                self.link.mav.heartbeat_send(KIND, AUTOPILOT, 209, self.mode, wire.MAV_STATE_ACTIVE)
            message = self.link.recv_match(blocking=True, timeout=0.02)
            kind = message.get_type() if message else ""
            self.setpoints += kind == "SET_ATTITUDE_TARGET"
            if kind == "COMMAND_LONG":
                if message.command == wire.MAV_CMD_DO_SET_MODE:
                    main, sub = int(message.param2), int(message.param3)
                    self.mode = px4(main, sub) if AUTOPILOT != ARDUPILOT else main
                self.link.mav.command_ack_send(message.command, 0)

async def main():
    vehicle, modes = Vehicle(), []
    vehicle.start()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(f"udpin://127.0.0.1:{PORT}")
    system = await mavsdk.first_autopilot(10.0)
    offboard = OffboardAsync(system)

    async def watch():
        async for mode in TelemetryAsync(system).subscribe_flight_mode():
            modes.append(FlightMode(mode).name)

    async def seen(what, after=0.0):
        """Setpoints a second, whether offboard is called active, and the mode as MAVSDK reads it."""
        await asyncio.sleep(after)
        before = vehicle.setpoints
        await asyncio.sleep(2.0)
        rate, active = (vehicle.setpoints - before) / 2.0, await offboard.is_active()
        print(f"{WHO:10} {what:28} {rate:5.1f} setpoints a second, is_active {active!s:5}, mode reads {modes[-1]}")
        return 17 < rate < 23 if rate else None, active, modes[-1]

    watching = asyncio.create_task(watch())
    await offboard.set_attitude(Attitude(10.0, 5.0, 0.0, 0.5))
    assert await seen("set, not started") == (True, True, "HOLD")
    await offboard.start()
    assert vehicle.mode == OFFBOARD
    started = await seen("started, 3 to 5 s later", 3.5)
    assert started == ((None, False, "UNKNOWN") if WHO == "ArduPlane" else (True, True, "OFFBOARD"))
    if WHO == "ArduPlane":
        for name, number in (("FBWA", 5), ("FBWB", 6), ("CRUISE", 7)):
            vehicle.mode = HOLD
            await asyncio.sleep(0.6)
            vehicle.mode = number
            assert (await seen(name))[2] == "UNKNOWN"
    if WHO == "PX4":
        vehicle.mode = HOLD
        assert await seen("pilot has taken over", 2.0) == (None, False, "HOLD")
        vehicle.mode = OFFBOARD
        assert await seen("pilot has given back", 2.0) == (None, False, "OFFBOARD")
        await offboard.set_attitude(Attitude(10.0, 5.0, 0.0, 0.5))
        await offboard.start()
        vehicle.silent = True
        assert (await seen("no heartbeat for 6 to 8 s", 6.0))[:2] == (True, True)
    watching.cancel()

asyncio.run(main())
sys.stdout.flush()
os._exit(0)
PYTHON
echo "MAVSDK 4.1.0, pymavlink 2.4.50"
for who in PX4 ArduPlane ArduCopter; do "$folder/v/bin/python" "$folder/beside.py" "$who" 2>&1 | sed '/_impl.cpp\|_connection.cpp/d'; done
