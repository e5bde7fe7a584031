#!/usr/bin/env bash
# MAVSDK 4.1.0 (Python) beside a vehicle that says that it is ArduPlane: `offboard.start()` asks for GUIDED and succeeds, but the library does not know a plane's GUIDED as OFFBOARD (it reads
# UNKNOWN). After three seconds it stops sending setpoints, without an error. A vehicle that says that it is ArduCopter gets them on and on. CRUISE, FBWA and FBWB of a plane read UNKNOWN as well.
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

KIND, GUIDED, OTHERS = {
    "plane": (wire.MAV_TYPE_FIXED_WING, 15, {"FBWA": 5, "FBWB": 6, "CRUISE": 7, "LOITER": 12}),
    "copter": (wire.MAV_TYPE_QUADROTOR, 4, {"LOITER": 5}),
}[sys.argv[1]]
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    PORT = free.getsockname()[1]

class Vehicle(threading.Thread):
    """Sends the heartbeats of ArduPilot, obeys DO_SET_MODE, counts setpoints."""

    def __init__(self):
        super().__init__(daemon=True)
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{PORT}", source_system=1, source_component=1, dialect="ardupilotmega")
        self.mode, self.setpoints = 0, 0

    def run(self):
        beat = 0.0
        while True:
            if time.monotonic() - beat > 0.2:
                beat = time.monotonic()
                self.link.mav.heartbeat_send(KIND, wire.MAV_AUTOPILOT_ARDUPILOTMEGA, 209, self.mode, wire.MAV_STATE_ACTIVE)
            message = self.link.recv_match(blocking=True, timeout=0.02)
            kind = message.get_type() if message else ""
            self.setpoints += kind == "SET_ATTITUDE_TARGET"
            if kind == "COMMAND_LONG":
                if message.command == wire.MAV_CMD_DO_SET_MODE:
                    self.mode = int(message.param2)
                self.link.mav.command_ack_send(message.command, 0)

async def main():
    vehicle, seen = Vehicle(), []
    vehicle.start()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(f"udpin://127.0.0.1:{PORT}")
    system = await mavsdk.first_autopilot(10.0)
    offboard = OffboardAsync(system)

    async def watch():
        async for mode in TelemetryAsync(system).subscribe_flight_mode():
            seen.append(FlightMode(mode).name)

    watching = asyncio.create_task(watch())
    await offboard.set_attitude(Attitude(10.0, 5.0, 0.0, 0.5))
    await offboard.start()
    counts = []
    for _ in range(3):
        before = vehicle.setpoints
        await asyncio.sleep(2.0)
        counts.append(vehicle.setpoints - before)
    active, guided = await offboard.is_active(), seen[-1]
    print(f"{sys.argv[1]}: start() took mode {vehicle.mode}; setpoints in seconds 0-2, 2-4, 4-6: {counts}; is_active {active}; GUIDED reads {guided}")
    assert vehicle.mode == GUIDED and counts[0] > 30
    assert (active, guided, counts[2] > 30) == ((False, "UNKNOWN", False) if sys.argv[1] == "plane" else (True, "OFFBOARD", True))
    assert sys.argv[1] == "copter" or counts[2] == 0
    for name, number in OTHERS.items():
        vehicle.mode = number
        await asyncio.sleep(0.8)
        print(f"{sys.argv[1]}: {name} reads {seen[-1]}")
        assert (seen[-1] == "UNKNOWN") == (name != "LOITER")
    watching.cancel()

asyncio.run(main())
print("MAVSDK 4.1.0, pymavlink 2.4.50", flush=True)
os._exit(0)
PYTHON
for kind in plane copter; do "$folder/v/bin/python" "$folder/beside.py" "$kind" 2>&1 | sed '/_impl.cpp\|_connection.cpp/d'; done
