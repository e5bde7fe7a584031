"""What clients and links do wrong, over real sockets: the aircraft flies on, and says what it did."""

import os

# Before pymavlink is loaded: PARAM_ERROR and COMMAND_ACK in full need MAVLink 2.
os.environ["MAVLINK20"] = "1"

import math  # noqa: E402
import random  # noqa: E402
import signal  # noqa: E402
import socket  # noqa: E402
import time  # noqa: E402

import flight  # noqa: E402
from flight import check, quaternion, roll_pitch, say  # noqa: E402
from offboard import (  # noqa: E402
    ARM,
    ATTITUDE_ONLY,
    FORCE,
    HOLD,
    OFFBOARD,
    SET_MODE,
    Offboard,
    custom_mode,
    mavlink,
)

# What is flown while others misbehave, and what the misbehaving ask for: far enough to be seen.
TARGET, FOREIGN = (15.0, 3.0), (-40.0, -15.0)
ACCEPTED, UNSUPPORTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_UNSUPPORTED
# The companion looks at its clocks every 10 ms, and a test machine has other things to do too.
LEAVES_WITHIN_S = 1.2


def check_unmoved(client, heard, what):
    """Nothing of what was heard shows another mode, target or attitude than the one flown."""
    targets = beats = 0
    for message in (h.message for h in heard):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            beats += 1
            check(message.custom_mode == custom_mode(OFFBOARD), f"{what}: OFFBOARD was left")
        elif kind == "ATTITUDE_TARGET":
            targets += 1
            off = [abs(a - b) for a, b in zip(roll_pitch(message.q), TARGET)]
            check(max(off) < 0.01, f"{what}: the target moved to {roll_pitch(message.q)}")
        elif kind == "ATTITUDE":
            off = abs(math.degrees(message.roll) - TARGET[0])
            check(off < 0.5, f"{what}: roll moved by {off:.2f} degrees")
    check(beats and targets, f"{what}: {beats} heartbeats, {targets} targets: too few to judge by")
    say(f"{what}: unmoved ({targets} targets, {beats} heartbeats)")


def foreign_setpoint(client):
    """A whole frame that asks for another attitude."""
    message = client.mav.set_attitude_target_encode(
        0, 1, 1, ATTITUDE_ONLY, quaternion(*FOREIGN), 0, 0, 0, 0.0
    )
    return message.pack(client.mav)


def garbage(client, port):
    """Truncated, bit-flipped, random datagrams; errors are counted, and counts are shown."""
    chance = random.Random(1)
    frame = foreign_setpoint(client)
    junk = [frame[:length] for length in range(len(frame))]
    for _ in range(2000):
        broken = bytearray(frame)
        at = chance.randrange(len(broken) * 8)
        broken[at // 8] ^= 1 << at % 8
        # A flipped sequence number spoils the checksum too: no flip leaves a valid frame.
        junk.append(bytes(broken))
        junk.append(chance.randbytes(chance.randrange(300)))
    stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    before = client.until(lambda m: m.get_type() == "SYS_STATUS", "SYS_STATUS").errors_comm
    start = len(client.heard)
    for count, datagram in enumerate(junk):
        stranger.sendto(datagram, ("127.0.0.1", port))
        client.link.port.sendto(datagram, ("127.0.0.1", port))
        if count % 20 == 0:
            client.turn()
    client.run(2.5)
    stranger.close()
    check_unmoved(client, client.heard[start:], f"{2 * len(junk)} broken datagrams")
    client.mark()
    after = client.until(lambda m: m.get_type() == "SYS_STATUS", "SYS_STATUS").errors_comm
    check(after > before + 1000, f"errors_comm went from {before} to {after} only")


def wrong_targets(client):
    """Commands, setpoints and parameters for others are not for us, and are not answered."""
    start = len(client.heard)
    for to in [(42, 1), (1, 42), (255, 190)]:
        client.mav.command_long_send(*to, ARM, 0, 0, FORCE, 0, 0, 0, 0, 0)
        client.mav.command_long_send(*to, SET_MODE, 0, 1, *HOLD, 0, 0, 0, 0)
        client.setpoint(*FOREIGN, to=to)
        client.mav.param_set_send(*to, b"GL_OFFB_LOSS_S", 0.1, mavlink.MAV_PARAM_TYPE_REAL32)
    heard = client.run(2.0)
    answers = [h.message for h in heard if h.message.get_type() in ("COMMAND_ACK", "PARAM_VALUE")]
    check(not answers, f"what was for others was answered: {answers}")
    check_unmoved(client, client.heard[start:], "requests for others")


def absurd_setpoints(client):
    """Numbers that are none are refused in words."""
    start = len(client.heard)
    nan = math.nan
    client.mark()
    for q in [[nan, 0, 0, 0], [1, 0, nan, 0], [1e30, 0, 0, 0], [1, math.inf, 0, 0], [0, 0, 0, 0]]:
        client.raw_setpoint(q)
    client.raw_setpoint(quaternion(*FOREIGN), thrust=1e30, mask=0b111)
    client.raw_setpoint(quaternion(*FOREIGN), mask=0b1000_0000)
    client.until_text("a number is NaN")
    client.until_text("the quaternion is zero")
    client.until_text("it has no attitude")
    client.mav.set_position_target_local_ned_send(0, 1, 1, 1, 0, *[1.0] * 11)
    client.until_text("only attitudes")
    client.run(1.5)
    check_unmoved(client, client.heard[start:], "absurd setpoints")


def unknown_commands(client):
    """Every command gets its answer, by LONG and by INT, and again when it is sent again."""
    nan = math.nan
    for number in [31999, 65535, 12345]:
        for _ in range(2):
            check(client.command(number, nan, 1e30) == UNSUPPORTED, f"command {number}")
        client.mark()
        client.mav.command_int_send(1, 1, 0, number, 0, 0, nan, 0, 0, 0, 2**31 - 1, 0, nan)
        check(client.acknowledged(number) == UNSUPPORTED, f"command {number} by INT")
    say("unknown commands are UNSUPPORTED")
    for parameter in [nan, 0.5, -1.0, 1e30]:
        check(client.command(ARM, parameter) == mavlink.MAV_RESULT_DENIED, f"arm {parameter}")
    say("arming with something else than 0 or 1 is DENIED")


def parameters(client):
    """A refusal by PARAM_ERROR beside the value in force."""
    for name, value in [(b"GL_SLEW_SURF", math.nan), (b"GL_SLEW_SURF", 1e30), (b"NO_SUCH", 1.0)]:
        client.mark()
        client.mav.param_set_send(1, 1, name, value, mavlink.MAV_PARAM_TYPE_REAL32)
        client.until(lambda m: m.get_type() == "PARAM_ERROR", f"PARAM_ERROR for {name} {value}")
    echoes = [h.message for h in client.heard if h.message.get_type() == "PARAM_VALUE"]
    check(echoes and all(e.param_value == 20.0 for e in echoes), f"GL_SLEW_SURF changed: {echoes}")
    say("bad parameters get PARAM_ERROR")


def flood(client, port):
    """Ten times the setpoints and requests that a link carries, for three seconds."""
    start, end = len(client.heard), time.monotonic() + 3.0
    sent = 0
    while time.monotonic() < end:
        for _ in range(10):
            client.setpoint(*TARGET)
            client.mav.param_request_list_send(1, 1)
            client.mav.command_long_send(1, 1, 31999, 0, 0, 0, 0, 0, 0, 0, 0)
            sent += 3
        client.turn()
    client.run(1.0)
    check_unmoved(client, client.heard[start:], f"a flood of {sent} frames in 3 s")


def second_client(client, port):
    """Another client gets all it asks for but the helm, while the first one steers."""
    start = len(client.heard)
    other = Offboard(f"udpout:127.0.0.1:{port}", component=77)
    other.target = FOREIGN
    other.mark()
    for _ in range(40):
        client.run(0.05)
        other.run(0.05)
    other.until_text("another client is sending")
    check(other.command(31999) == UNSUPPORTED, "the second client's command")
    other.until(lambda m: m.get_type() == "ATTITUDE", "the second client's stream")
    other.link.close()
    check_unmoved(client, client.heard[start:], "a second client")


def leaves_offboard(client, since, what):
    """The mode is left in time after `since`, with a heartbeat at once, and is not re-entered."""
    client.until_mode(HOLD)
    beat = next(
        h
        for h in client.heard[client.since :]
        if h.message.get_type() == "HEARTBEAT" and h.message.custom_mode == custom_mode(HOLD)
    )
    taken = beat.at - since
    say(f"{what}: HOLD in the heartbeat after {taken:.2f} s")
    check(0.9 <= taken <= LEAVES_WITHIN_S, f"{what}: HOLD after {taken:.2f} s")
    critical = mavlink.MAV_STATE_CRITICAL
    check(beat.message.system_status == critical, f"{what}: the heartbeat is not CRITICAL")
    client.until_text("setpoints lost")


def setpoint_loss(client):
    """Silence, then setpoints that are none: both end OFFBOARD, which is not entered again."""
    client.mark()
    client.target = None
    leaves_offboard(client, client.last_setpoint, "setpoints stop")
    client.target = TARGET
    heard = client.run(2.5)
    modes = {h.message.custom_mode for h in heard if h.message.get_type() == "HEARTBEAT"}
    check(modes == {custom_mode(HOLD)}, f"OFFBOARD was entered again by itself: {modes}")
    client.engage(*TARGET)
    client.mark()
    client.target, since = None, client.last_setpoint
    for _ in range(30):
        client.raw_setpoint([math.nan] * 4)
        client.run(0.05)
    leaves_offboard(client, since, "setpoints of NaN")


def client_restart(client, port):
    """A client that comes back at another port takes the helm when the old one has gone silent."""
    client.engage(*TARGET)
    client.until_attitude(*TARGET, hold=0.5)
    client.link.close()
    say("the client dies and comes back at another port")
    again = Offboard(f"udpout:127.0.0.1:{port}")
    again.target = TARGET
    # The old one holds the helm for a second, and its mode ends after the same silence.
    again.until_mode(HOLD, 3.0)
    again.engage(*TARGET)
    again.until_attitude(*TARGET, hold=0.5)
    return again


def lost_and_found(client, flown):
    """A vehicle that stops for 0.8 s: HOLD at once; it flies on by itself when it is back."""
    client.mark()
    flown.shim.signal(signal.SIGSTOP)
    stopped = time.monotonic()
    client.until_text("vehicle link lost", 2.0)
    taken = time.monotonic() - stopped
    check(taken <= 0.8, f"the vehicle's loss was told after {taken:.2f} s")
    beat = client.until_mode(HOLD, 0.5)
    check(beat.system_status == mavlink.MAV_STATE_CRITICAL, "the heartbeat is not CRITICAL")
    client.run(max(0.0, stopped + 0.8 - time.monotonic()))
    client.mark()
    flown.shim.signal(signal.SIGCONT)
    client.until_text("vehicle link back")
    check_active(client)
    client.engage(*TARGET)
    client.until_attitude(*TARGET, hold=0.5)


def killed_and_started(client, flown):
    """A vehicle that dies and starts anew: its clock goes back, the companion goes on in HOLD."""
    client.mark()
    flown.shim.process.kill()
    flown.shim.process.wait()
    client.until_text("vehicle link lost", 2.0)
    client.until_mode(HOLD, 0.5)
    client.run(1.0)
    client.mark()
    flown.start_shim()
    client.until_text("vehicle clock jumped back", 10.0)
    check_active(client)
    client.engage(*TARGET)
    client.until_attitude(*TARGET, hold=0.5)


def check_active(client):
    """The heartbeat says that all is well again, in HOLD."""
    active = mavlink.MAV_STATE_ACTIVE
    beat = client.until(
        lambda m: m.get_type() == "HEARTBEAT" and m.system_status == active, "ACTIVE heartbeat"
    )
    check(beat.custom_mode == custom_mode(HOLD), "the vehicle's return changed the mode")


def main():
    """Goes through all of it in one flight."""
    arguments = flight.arguments(__doc__)
    port = flight.free_ports(1)[0]
    with flight.Flight(arguments, [f"udpin:127.0.0.1:{port}"]) as flown:
        client = Offboard(f"udpout:127.0.0.1:{port}")
        client.arm()
        client.engage(*TARGET)
        client.until_attitude(*TARGET, hold=0.5)
        garbage(client, port)
        wrong_targets(client)
        absurd_setpoints(client)
        unknown_commands(client)
        parameters(client)
        flood(client, port)
        second_client(client, port)
        setpoint_loss(client)
        client = client_restart(client, port)
        lost_and_found(client, flown)
        killed_and_started(client, flown)
        check(client.command(ARM, 0, FORCE) == ACCEPTED, "forced disarming failed")
        client.link.close()
        flown.land()


flight.run(main, 180)
