"""QGroundControl's connect sequence, step by step with its own time-outs.

The steps are those of QGroundControl's InitialConnectStateMachine: version, standard modes,
component information, parameters, mission, fence, rally points; then what its window asks for:
home, message intervals, camera, gimbal. Of the parameters one in five is lost on the way, and
asked for again by index.
"""

import os
import time

# QGroundControl speaks all dialects; 300 (PROTOCOL_VERSION) is in none of this pymavlink's.
os.environ["MAVLINK_DIALECT"] = "all"
os.environ["MAVLINK20"] = "1"

import flight  # noqa: E402
from flight import check, say  # noqa: E402
from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink
# Of a command: acknowledged within 3 s, tried three times; the message follows within 1 s.
ACK_S, TRIES, MESSAGE_S = 3.0, 3, 1.0
# Of the parameters: the first within 5 s; 3 s without one, and what is missing is asked for, ten
# at a time, five times.
FIRST_S, WAITING_S, BATCH, ROUNDS = 5.0, 3.0, 10, 5
# Of mission, fence and rally points: the count within 1.5 s, tried five times.
PLAN_S, PLAN_TRIES = 1.5, 5
PROTOCOL_VERSION = 300
ACCEPTED, UNSUPPORTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_UNSUPPORTED


def sender(message):
    """System and component; of a message that pymavlink does not know they stand in its bytes."""
    if isinstance(message, mavlink.MAVLink_unknown):
        return message.data[5], message.data[6]
    return message.get_srcSystem(), message.get_srcComponent()


class GroundStation:
    """255/190, speaking to one component of system 1."""

    def __init__(self, address, component):
        self.component = component
        self.link = mavutil.mavlink_connection(address, source_system=255, source_component=190)
        self.mav = self.link.mav
        self.next_heartbeat = 0.0
        self.beat = self.until(lambda m: m.get_type() == "HEARTBEAT", 10.0)
        check(self.beat is not None, f"no heartbeat of component {component}")

    def until(self, wanted, seconds):
        """The next message of the component that is as wanted, or none in time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if time.monotonic() >= self.next_heartbeat:
                self.next_heartbeat = time.monotonic() + 1.0
                self.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
            message = self.link.recv_match(blocking=True, timeout=0.05)
            if message and sender(message) == (1, self.component) and wanted(message):
                return message
        return None

    def command(self, number, *params):
        """The result of a command; it has to be acknowledged."""
        padded = [*params, *[0.0] * (7 - len(params))]
        for attempt in range(TRIES):
            self.mav.command_long_send(1, self.component, number, attempt, *padded)
            ack = self.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number, ACK_S)
            if ack:
                return ack.result
        raise flight.Failure(f"command {number} was never acknowledged")

    def request(self, message_id, index=0.0):
        """REQUEST_MESSAGE: the first message, when the request is accepted; else the result."""
        result = self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id, index)
        if result != ACCEPTED:
            return result
        names = f"UNKNOWN_{message_id}"
        message = self.until(
            lambda m: m.get_msgId() == message_id or m.get_type() == names, MESSAGE_S
        )
        check(message is not None, f"message {message_id} was accepted, but did not come")
        return message

    def version(self):
        """AUTOPILOT_VERSION by the request of today and by the old one."""
        new = self.request(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        check(not isinstance(new, int), f"AUTOPILOT_VERSION: result {new}")
        old = self.command(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)
        check(old == ACCEPTED, f"REQUEST_AUTOPILOT_CAPABILITIES: result {old}")
        again = self.until(lambda m: m.get_type() == "AUTOPILOT_VERSION", MESSAGE_S)
        check(again and again.capabilities == new.capabilities, "the two ways differ")
        check(new.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2, "no MAVLink 2")
        encodings = (
            mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
            mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        )
        check(sum(bool(new.capabilities & bit) for bit in encodings) == 1, "parameter encoding")
        check(new.flight_sw_version != 0, "no version")
        protocol = self.request(PROTOCOL_VERSION)
        check(not isinstance(protocol, int), f"PROTOCOL_VERSION: result {protocol}")
        say(f"version {new.flight_sw_version:#010x}, capabilities {new.capabilities:#x}")
        return new.capabilities

    def modes(self):
        """AVAILABLE_MODES, all at once; the mode of the heartbeat is among them."""
        mode = self.request(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES)
        check(not isinstance(mode, int), f"AVAILABLE_MODES: result {mode}")
        known = {mode.mode_index: mode}
        while mode.mode_index < mode.number_modes:
            mode = self.until(lambda m: m.get_type() == "AVAILABLE_MODES", MESSAGE_S)
            check(mode is not None, f"modes {sorted(known)} only")
            known[mode.mode_index] = mode
        check(sorted(known) == list(range(1, mode.number_modes + 1)), f"modes {sorted(known)}")
        names = [mode.mode_name for mode in known.values()]
        check(len(set(names)) == len(names) and all(names), f"names {names}")
        beat = self.until(lambda m: m.get_type() == "HEARTBEAT", 2.0)
        numbers = [mode.custom_mode for mode in known.values()]
        check(beat and beat.custom_mode in numbers, f"{beat} is in none of {numbers}")
        single = self.request(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES, 2)
        check(not isinstance(single, int) and single.mode_index == 2, f"mode 2: {single}")
        say(f"modes {', '.join(names)}")

    def component_information(self):
        """COMPONENT_METADATA, then COMPONENT_INFORMATION: not here, and that is said at once."""
        for message_id in [397, 395]:
            begun = time.monotonic()
            result = self.request(message_id)
            check(result == UNSUPPORTED, f"message {message_id}: {result}")
            check(time.monotonic() - begun < 1.0, "the refusal came late")

    def parameters(self):
        """All parameters, although one in five is lost."""
        self.mav.param_request_list_send(1, self.component)
        known, count, heard, lost = {}, None, 0, 0
        wait = FIRST_S
        for _ in range(ROUNDS + 1):
            while True:
                value = self.until(lambda m: m.get_type() == "PARAM_VALUE", wait)
                if value is None:
                    break
                wait, heard = WAITING_S, heard + 1
                check(count in (None, value.param_count), "the count changes")
                count = value.param_count
                # Before the first round nothing is asked for again.
                if heard % 5 == 0:
                    lost += 1
                    continue
                known[value.param_index] = value.param_id
                if len(known) == count:
                    break
            check(count is not None, "no parameter came")
            missing = [index for index in range(count) if index not in known]
            if not missing:
                break
            for index in missing[:BATCH]:
                self.mav.param_request_read_send(1, self.component, b"", index)
        check(sorted(known) == list(range(count)), f"{len(known)} of {count} parameters")
        check(len(set(known.values())) == count, "names are not unique")
        check(lost > 0, "nothing was lost: the test is no test")
        say(f"{count} parameters, {lost} lost and asked for again by index")

    def plans(self):
        """Mission, fence, rally points: none of each, each answered with its own type."""
        for kind in [
            mavlink.MAV_MISSION_TYPE_MISSION,
            mavlink.MAV_MISSION_TYPE_FENCE,
            mavlink.MAV_MISSION_TYPE_RALLY,
        ]:
            for _ in range(PLAN_TRIES):
                self.mav.mission_request_list_send(1, self.component, kind)
                count = self.until(lambda m: m.get_type() == "MISSION_COUNT", PLAN_S)
                if count:
                    break
            check(count is not None, f"no count of mission type {kind}")
            check((count.count, count.mission_type) == (0, kind), f"mission type {kind}: {count}")
            check((count.target_system, count.target_component) == (255, 190), f"to whom: {count}")
            self.mav.mission_ack_send(1, self.component, mavlink.MAV_MISSION_ACCEPTED, kind)
        say("mission, fence, rally points: 0 of each")

    def window(self, has_home):
        """What the window asks for once all is loaded."""
        home = self.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        if has_home:
            check(not isinstance(home, int), f"HOME_POSITION: result {home}")
            check(abs(home.latitude - 468_000_000) < 100_000, f"home {home}")
            check(abs(home.altitude - 600_000) < 20_000, f"home {home}")
        attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
        result = self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, attitude, 40_000)
        check(result == ACCEPTED, f"SET_MESSAGE_INTERVAL: result {result}")
        self.until(lambda m: False, 0.3)
        heard, end = 0, time.monotonic() + 2.0
        while time.monotonic() < end:
            left = max(0.01, end - time.monotonic())
            heard += self.until(lambda m: m.get_msgId() == attitude, left) is not None
        interval = self.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, attitude)
        check(interval == ACCEPTED, f"GET_MESSAGE_INTERVAL: result {interval}")
        interval = self.until(lambda m: m.get_type() == "MESSAGE_INTERVAL", MESSAGE_S)
        check(interval and interval.message_id == attitude, f"MESSAGE_INTERVAL: {interval}")
        # Camera and gimbal manager: none, said at once.
        for message_id in [259, 280]:
            result = self.request(message_id)
            check(result == UNSUPPORTED, f"message {message_id}: {result}")
        say(f"ATTITUDE_QUATERNION {heard / 2.0:g} Hz, asked for 25 Hz, in force {interval.interval_us} µs")
        return heard / 2.0

    def connect(self):
        """The whole sequence; the rate at which ATTITUDE_QUATERNION then comes, and the time taken."""
        begun = time.monotonic()
        self.version()
        self.modes()
        self.component_information()
        self.parameters()
        self.plans()
        say(f"connected after {time.monotonic() - begun:.1f} s")
        hz = self.window(has_home=True)
        self.link.close()
        return hz


def main():
    """Connects to a companion, to played controllers through one, and to the one that routes."""
    arguments = flight.arguments(__doc__)
    for personality, component in [
        (None, 1),
        ("px4", 1),
        ("ardupilot", 1),
        ("px4", 191),
    ]:
        port = flight.free_ports(1)[0]
        through = f"{personality} through the companion" if component == 1 else "the companion beside it"
        say(f"== component {component}: {through if personality else 'the companion'}")
        with flight.Flight(arguments, [f"udpin:127.0.0.1:{port}"], personality) as flown:
            hz = GroundStation(f"udpout:127.0.0.1:{port}", component).connect()
            # The controller has one table of rates, and the companion asks it for 100 Hz.
            most = 30.0 if personality is None or component == 191 else 105.0
            check(17.5 < hz < most, f"{hz:g} Hz")
            flown.end()


flight.run(main, 240)
