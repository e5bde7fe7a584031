"""MAVSDK through the routing companion: it flies the controller, then Greylag beside it."""

import asyncio
import json

import flight
from flight import NEAR_DEG, OWN_ERROR_DEG, PITCH_DEG, ROLL_DEG, check, quaternion, roll_pitch, say
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage
from mavsdk.asyncio.plugins.offboard import Attitude, OffboardAsync, OffboardError
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync

GREYLAG = 191


async def until(stream, wanted, what, seconds=10.0):
    """The first item of a stream that is as wanted."""

    async def search():
        async for item in stream:
            if wanted(item):
                return item
        raise flight.Failure(f"no {what}: the stream has ended")

    try:
        return await asyncio.wait_for(search(), seconds)
    except asyncio.TimeoutError:
        raise flight.Failure(f"no {what} within {seconds:g} s") from None


async def settle(telemetry, near=NEAR_DEG):
    """Waits until the attitude has been near for two seconds."""
    since = last = None

    def settled(q):
        nonlocal since, last
        last = roll_pitch([q.w, q.x, q.y, q.z])
        close = max(abs(last[0] - ROLL_DEG), abs(last[1] - PITCH_DEG)) <= near
        now = asyncio.get_running_loop().time()
        since = (since or now) if close else None
        return since is not None and now - since >= 2.0

    try:
        await until(telemetry.subscribe_attitude_quaternion(), settled, "settled attitude", 25.0)
    finally:
        say(f"attitude {last} degrees for {ROLL_DEG:g} / {PITCH_DEG:g}")


async def fly_controller(system, telemetry):
    """The controller's own parameters and its OFFBOARD mode, through the companion."""
    table = await ParamAsync(system).get_all_params()
    names = [p.name for p in [*table.float_params, *table.int_params]]
    say(f"{len(names)} parameters of the controller")
    check("COM_OF_LOSS_T" in names and "GL_BANK_MAX_DEG" not in names, f"parameters: {names}")
    modes = telemetry.subscribe_flight_mode
    await until(modes(), lambda m: m == FlightMode.HOLD, "hold in telemetry")
    await until(telemetry.subscribe_armed(), bool, "an armed controller")
    offboard = OffboardAsync(system)
    try:
        await offboard.start()
        raise flight.Failure("offboard without a setpoint was not refused")
    except OffboardError as reason:
        say(f"offboard without a setpoint: refused ({reason})")
    await offboard.set_attitude(Attitude(ROLL_DEG, PITCH_DEG, 0.0, 0.5))
    await offboard.start()
    await until(modes(), lambda m: m == FlightMode.OFFBOARD, "offboard in telemetry")
    await settle(telemetry, OWN_ERROR_DEG)
    say("offboard.stop, which asks for HOLD")
    await offboard.stop()
    await until(modes(), lambda m: m == FlightMode.HOLD, "hold in telemetry")
    await ActionAsync(system).hold()


class Pilot:
    """Greylag, spoken to by messages of its component id."""

    def __init__(self, direct):
        self.direct = direct

    async def send(self, name, **fields):
        """One message."""
        body = json.dumps({"target_system": 1, "target_component": GREYLAG, **fields})
        await self.direct.send_message(MavlinkMessage(name, 245, 190, 1, GREYLAG, body))

    async def command(self, number, *params):
        """A command, and its result."""
        padded = [*params, *[0.0] * (7 - len(params))]
        fields = {f"param{i + 1}": value for i, value in enumerate(padded)}
        fields.update(target_system=1, target_component=GREYLAG, command=number, confirmation=0)
        body = json.dumps(fields)
        command = MavlinkMessage("COMMAND_LONG", 245, 190, 1, GREYLAG, body)
        ack = await self.direct.send_command(command)
        say(f"command {number} to component {GREYLAG}: {ack.fields_json}")
        return json.loads(ack.fields_json)["result"]

    async def steer(self):
        """Setpoints, until cancelled."""
        q = quaternion(ROLL_DEG, PITCH_DEG)
        while True:
            await self.send(
                "SET_ATTITUDE_TARGET",
                time_boot_ms=0,
                type_mask=0b0100_0111,
                q=q,
                body_roll_rate=0.0,
                body_pitch_rate=0.0,
                body_yaw_rate=0.0,
                thrust=0.0,
            )
            await asyncio.sleep(0.05)


async def fly_greylag(system, telemetry):
    """Engages Greylag, which steers through the controller's MANUAL mode."""
    pilot = Pilot(MavlinkDirectAsync(system))
    check(await pilot.command(400, 1.0) == 0, "Greylag was not engaged")
    steering = asyncio.create_task(pilot.steer())
    try:
        await asyncio.sleep(0.5)
        check(await pilot.command(176, 1.0, 6.0) == 0, "Greylag did not enter OFFBOARD")
        modes = telemetry.subscribe_flight_mode
        await until(modes(), lambda m: m == FlightMode.MANUAL, "the controller in MANUAL")
        await settle(telemetry)
        check(await pilot.command(400, 0.0, 21196.0) == 0, "Greylag was not disengaged")
        await until(modes(), lambda m: m == FlightMode.HOLD, "the controller in HOLD again")
    finally:
        steering.cancel()


async def fly(address):
    """Flies over one connection."""
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        say(f"connecting MAVSDK {await mavsdk.version()} to {address}")
        await mavsdk.add_any_connection(address)
        system = await mavsdk.first_autopilot(10.0)
        check(system is not None, "MAVSDK found no autopilot")
        telemetry = TelemetryAsync(system)
        await fly_controller(system, telemetry)
        await fly_greylag(system, telemetry)


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port = flight.free_ports(1)[0]
    with flight.Flight(arguments, [f"udpout:127.0.0.1:{port}"], "px4") as flown:
        asyncio.run(fly(f"udpin://127.0.0.1:{port}"))
        flown.land()


flight.run(main, 150)
