"""MAVSDK 3.17 through the routing companion: it flies the controller, then Greylag beside it."""

import asyncio
import json

import flight
from flight import NEAR_DEG, OWN_ERROR_DEG, PITCH_DEG, ROLL_DEG, check, quaternion, roll_pitch, say
from mavsdk import System
from mavsdk.mavlink_direct import MavlinkMessage
from mavsdk.offboard import Attitude, OffboardError
from mavsdk.telemetry import FlightMode

GREYLAG = 191
# What MAVSDK is by default.
ITSELF = {"target_system": 245, "target_component": 190}


async def until(stream, wanted, what, seconds=15.0):
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


async def settle(drone, near):
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
        await until(drone.telemetry.attitude_quaternion(), settled, "settled attitude", 25.0)
    finally:
        say(f"attitude {last} degrees for {ROLL_DEG:g} / {PITCH_DEG:g}")


async def fly_controller(drone):
    """The controller's own parameters and its OFFBOARD mode, through the companion."""
    table = await drone.param.get_all_params()
    names = [p.name for p in [*table.float_params, *table.int_params]]
    say(f"{len(names)} parameters of the controller")
    check("COM_OF_LOSS_T" in names and "GL_BANK_MAX_DEG" not in names, f"parameters: {names}")
    modes = drone.telemetry.flight_mode
    await until(modes(), lambda m: m == FlightMode.HOLD, "hold in telemetry")
    await until(drone.telemetry.armed(), bool, "an armed controller")
    try:
        await drone.offboard.start()
        raise flight.Failure("offboard without a setpoint was not refused")
    except OffboardError as reason:
        say(f"offboard without a setpoint: refused ({reason})")
    await drone.offboard.set_attitude(Attitude(ROLL_DEG, PITCH_DEG, 0.0, 0.5))
    await drone.offboard.start()
    await until(modes(), lambda m: m == FlightMode.OFFBOARD, "offboard in telemetry")
    await settle(drone, OWN_ERROR_DEG)
    say("offboard.stop, which asks for HOLD")
    await drone.offboard.stop()
    await until(modes(), lambda m: m == FlightMode.HOLD, "hold in telemetry")
    await drone.action.hold()


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

        def answers(message):
            fields = json.loads(message.fields_json)
            return message.component_id == GREYLAG and fields["command"] == number

        acks = self.direct.message("COMMAND_ACK")
        answer = asyncio.create_task(until(acks, answers, f"answer to command {number}"))
        # The stream has to be open before the answer comes.
        await asyncio.sleep(0.3)
        padded = [*params, *[0.0] * (7 - len(params))]
        fields = {f"param{i + 1}": value for i, value in enumerate(padded)}
        await self.send("COMMAND_LONG", command=number, confirmation=0, **fields)
        ack = json.loads((await answer).fields_json)
        say(f"command {number} to component {GREYLAG}: {ack}")
        check({k: ack[k] for k in ITSELF} == ITSELF, "the answer is for somebody else")
        return ack["result"]

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


async def fly_greylag(drone):
    """Engages Greylag, which steers through the controller's MANUAL mode."""
    pilot = Pilot(drone.mavlink_direct)
    check(await pilot.command(400, 1.0) == 0, "Greylag was not engaged")
    steering = asyncio.create_task(pilot.steer())
    try:
        await asyncio.sleep(0.5)
        check(await pilot.command(176, 1.0, 6.0) == 0, "Greylag did not enter OFFBOARD")
        modes = drone.telemetry.flight_mode
        await until(modes(), lambda m: m == FlightMode.MANUAL, "the controller in MANUAL")
        await settle(drone, NEAR_DEG)
        check(await pilot.command(400, 0.0, 21196.0) == 0, "Greylag was not disengaged")
        await until(modes(), lambda m: m == FlightMode.HOLD, "the controller in HOLD again")
    finally:
        steering.cancel()


async def fly(address, port):
    """Flies over one connection."""
    drone = System(port=port)
    say(f"connecting MAVSDK 3.17 to {address}")
    await asyncio.wait_for(drone.connect(system_address=address), 30.0)
    await until(drone.core.connection_state(), lambda state: state.is_connected, "connection", 30.0)
    await fly_controller(drone)
    await fly_greylag(drone)


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port, grpc = flight.free_ports(2)
    with flight.Flight(arguments, [f"udpout:127.0.0.1:{port}"], "px4") as flown:
        asyncio.run(fly(f"udpin://127.0.0.1:{port}", grpc))
        flown.land()


flight.run(main, 200)
