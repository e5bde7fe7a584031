"""A flight with MAVSDK: parameters, arming, offboard, an attitude, hold, disarming."""

import asyncio
import math

import flight
from flight import NEAR_DEG, PITCH_DEG, ROLL_DEG, check, say
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.offboard import Attitude, OffboardAsync, OffboardError
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync
from pymavlink import mavutil


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


async def refused(call, error, what):
    """Awaits a call that has to fail with `error`."""
    try:
        await call
    except error as reason:
        say(f"{what}: refused ({reason})")
        return
    raise flight.Failure(f"{what} was not refused")


async def set_parameters(parameters):
    """All are read; one value is taken, one is refused, a whole number keeps its type."""
    table = await parameters.get_all_params()
    names = [p.name for p in [*table.float_params, *table.int_params]]
    say(f"{len(table.float_params)} real and {len(table.int_params)} whole parameters")
    check("GL_BANK_MAX_DEG" in names and "GL_THRUST_SRC" in names, f"parameters: {names}")
    before = await parameters.get_param_float("GL_BANK_MAX_DEG")
    await parameters.set_param_float("GL_BANK_MAX_DEG", before - 5.0)
    await refused(
        parameters.set_param_float("GL_BANK_MAX_DEG", 500.0), ParamError, "a bank of 500 degrees"
    )
    now = await parameters.get_param_float("GL_BANK_MAX_DEG")
    check(now == before - 5.0, f"GL_BANK_MAX_DEG is {now}")
    await parameters.set_param_float("GL_BANK_MAX_DEG", before)
    await refused(parameters.get_param_float("NO_SUCH_THING"), ParamError, "an unknown name")
    await parameters.set_param_int("GL_THRUST_SRC", 0)
    check(await parameters.get_param_int("GL_THRUST_SRC") == 0, "GL_THRUST_SRC")


async def fly_attitude(telemetry):
    """Waits until the attitude has been near for two seconds."""
    since = None
    last = None

    def settled(angle):
        nonlocal since, last
        last = (angle.roll_deg, angle.pitch_deg)
        near = max(abs(last[0] - ROLL_DEG), abs(last[1] - PITCH_DEG)) <= NEAR_DEG
        now = asyncio.get_running_loop().time()
        since = (since or now) if near else None
        return since is not None and now - since >= 2.0

    try:
        await until(telemetry.subscribe_attitude_euler(), settled, "settled attitude", 20.0)
    finally:
        say(f"attitude {last} degrees for {ROLL_DEG:g} / {PITCH_DEG:g}")


async def fly(address):
    """Flies over one connection."""
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        say(f"connecting MAVSDK {await mavsdk.version()} to {address}")
        await mavsdk.add_any_connection(address)
        system = await mavsdk.first_autopilot(10.0)
        check(system is not None, "MAVSDK found no autopilot")
        action, offboard = ActionAsync(system), OffboardAsync(system)
        telemetry = TelemetryAsync(system)
        await until(telemetry.subscribe_health_all_ok(), bool, "good health")
        await set_parameters(ParamAsync(system))

        await refused(offboard.start(), OffboardError, "offboard without a setpoint")
        say("arming")
        await action.arm()
        await until(telemetry.subscribe_armed(), bool, "arming in telemetry")

        say(f"offboard to {ROLL_DEG:g} / {PITCH_DEG:g} degrees")
        await offboard.set_attitude(Attitude(ROLL_DEG, PITCH_DEG, 0.0, 0.5))
        await offboard.start()
        modes = telemetry.subscribe_flight_mode
        await until(modes(), lambda m: m == FlightMode.OFFBOARD, "offboard in telemetry")
        check(await offboard.is_active(), "MAVSDK says that offboard is not active")
        await fly_attitude(telemetry)

        say("offboard.stop, which asks for HOLD")
        await offboard.stop()
        await until(modes(), lambda m: m == FlightMode.HOLD, "hold in telemetry")
        await action.hold()
        await refused(action.return_to_launch(), ActionError, "return to launch")
        await refused(action.disarm(), ActionError, "disarming in flight")
        say("action.kill, which disarms by force")
        await action.kill()
        await until(telemetry.subscribe_armed(), lambda armed: not armed, "disarming in telemetry")


def check_nan(folder):
    """MAVSDK's commands held NaN in what they do not use; the recording shows what became of it."""
    log = mavutil.mavlink_connection(str(folder / "flight.tlog"))
    sent, with_nan, accepted = set(), set(), set()
    while (message := log.recv_match(type=["COMMAND_LONG", "COMMAND_ACK"])) is not None:
        if message.get_type() == "COMMAND_ACK":
            if message.result == mavutil.mavlink.MAV_RESULT_ACCEPTED:
                accepted.add(message.command)
            continue
        sent.add(message.command)
        if any(math.isnan(getattr(message, f"param{i}")) for i in range(1, 8)):
            with_nan.add(message.command)
    say(f"commands {sorted(sent)}, with NaN {sorted(with_nan)}, accepted {sorted(accepted)}")
    for number in [400, 176]:
        check(number in with_nan, f"MAVSDK sent no NaN in command {number}: choose another")
        check(number in accepted, f"command {number} was never accepted")


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port = flight.free_ports(1)[0]
    # The companion sends to an offboard program's port by itself, as PX4 does to 14540.
    with flight.Flight(arguments, [f"udpout:127.0.0.1:{port}"]) as flown:
        asyncio.run(fly(f"udpin://127.0.0.1:{port}"))
        flown.land()
        check_nan(flown.recording)


flight.run(main, 120)
