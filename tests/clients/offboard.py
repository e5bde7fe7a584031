"""A pymavlink client that keeps up its heartbeat and its setpoints while it waits."""

import collections
import math
import time

from flight import NEAR_DEG, Failure, check, quaternion, roll_pitch, say
from pymavlink import mavutil

mavlink = mavutil.mavlink
# Modes as PX4 numbers them: main and sub mode.
HOLD, OFFBOARD = (4, 3), (6, 0)
ARM, SET_MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
FORCE = 21196
SETPOINT_PERIOD = 0.05
# Attitude alone counts: the three rates and thrust are ignored.
ATTITUDE_ONLY = 0b0100_0111

Heard = collections.namedtuple("Heard", "at message")


def custom_mode(mode):
    """The heartbeat's custom_mode."""
    return mode[0] << 16 | mode[1] << 24


class Offboard:
    """One client; `heard` holds all that it was sent, with the time of arrival.

    `until` and its kin look at everything since the last `mark`, which each request sets: so the
    order of an answer's parts does not matter.
    """

    def __init__(self, address, component=mavlink.MAV_COMP_ID_MISSIONPLANNER, pilot=(1, 1)):
        self.pilot = pilot
        self.link = mavutil.mavlink_connection(address, source_system=255, source_component=component)
        self.mav = self.link.mav
        self.heard, self.since, self.target, self.last_setpoint = [], 0, None, None
        self.next_setpoint = self.next_heartbeat = 0.0
        self.until(self.beats, f"heartbeat of {pilot}")

    def beats(self, message):
        """Whether a message is a heartbeat of the autopilot that is spoken to."""
        sender = (message.get_srcSystem(), message.get_srcComponent())
        return message.get_type() == "HEARTBEAT" and sender == self.pilot

    def turn(self):
        """Sends what is due and takes in what has come, for a hundredth of a second at most."""
        now = time.monotonic()
        if now >= self.next_heartbeat:
            self.next_heartbeat = now + 1.0
            self.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        if self.target and now >= self.next_setpoint:
            self.next_setpoint = now + SETPOINT_PERIOD
            self.setpoint(*self.target)
            self.last_setpoint = now
        message = self.link.recv_match(blocking=True, timeout=0.01)
        if message is None:
            return []
        found = []
        while message is not None:
            found.append(message)
            self.heard.append(Heard(time.monotonic(), message))
            message = self.link.recv_match(blocking=False)
        return found

    def setpoint(self, roll_deg, pitch_deg, to=None):
        """One setpoint."""
        self.raw_setpoint(quaternion(roll_deg, pitch_deg), to)

    def raw_setpoint(self, q, to=None, thrust=0.0, mask=ATTITUDE_ONLY):
        """One setpoint of any numbers."""
        self.mav.set_attitude_target_send(0, *(to or self.pilot), mask, q, 0, 0, 0, thrust)

    def mark(self):
        """What is waited for from now on has to come from now on."""
        self.since = len(self.heard)

    def run(self, seconds):
        """Goes on for a time; what was heard in it."""
        start, end = len(self.heard), time.monotonic() + seconds
        while time.monotonic() < end:
            self.turn()
        return self.heard[start:]

    def until(self, wanted, what, seconds=5.0):
        """Goes on until a message is as wanted, and returns it."""
        end, looked = time.monotonic() + seconds, self.since
        while True:
            for heard in self.heard[looked:]:
                if wanted(heard.message):
                    return heard.message
            looked = len(self.heard)
            check(time.monotonic() < end, f"no {what} within {seconds:g} s")
            self.turn()

    def until_text(self, words, seconds=5.0):
        """Goes on until a STATUSTEXT (one chunk of it) has these words."""

        def has(message):
            return message.get_type() == "STATUSTEXT" and words in message.text

        text = self.until(has, f"STATUSTEXT {words!r}", seconds)
        say(f'STATUSTEXT "{text.text}"')

    def texts(self, heard):
        """The texts among what was heard."""
        return [h.message.text for h in heard if h.message.get_type() == "STATUSTEXT"]

    def until_mode(self, mode, seconds=5.0):
        """Goes on until the heartbeat shows a mode."""

        def shows(message):
            return self.beats(message) and message.custom_mode == custom_mode(mode)

        return self.until(shows, f"heartbeat in mode {mode}", seconds)

    def command(self, number, *params):
        """Sends a command and returns the result of its acknowledgement."""
        self.mark()
        padded = [*params, *[0.0] * (7 - len(params))]
        self.mav.command_long_send(*self.pilot, number, 0, *padded)
        return self.acknowledged(number)

    def acknowledged(self, number):
        """The result of a command that has been sent."""

        def answers(message):
            sender = (message.get_srcSystem(), message.get_srcComponent())
            answer = message.get_type() == "COMMAND_ACK" and message.command == number
            return answer and sender == self.pilot

        # Half a second is what mavlink.md allows.
        return self.until(answers, f"acknowledgement of command {number}", 0.5).result

    def arm(self):
        """Arms; a controller that has just started may reject that for the time being."""
        deadline = time.monotonic() + 5
        result = self.command(ARM, 1)
        while result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED and time.monotonic() < deadline:
            time.sleep(0.2)
            result = self.command(ARM, 1)
        check(result == mavlink.MAV_RESULT_ACCEPTED, f"arming: result {result}")
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        self.until(lambda m: self.beats(m) and m.base_mode & armed, "heartbeat that is armed")

    def engage(self, roll_deg, pitch_deg):
        """Sends setpoints and enters OFFBOARD."""
        self.target = (roll_deg, pitch_deg)
        # The companion wants a fresh setpoint before it enters OFFBOARD.
        self.run(0.3)
        result = self.command(SET_MODE, 1, *OFFBOARD)
        check(result == mavlink.MAV_RESULT_ACCEPTED, f"OFFBOARD: result {result}")
        self.until_mode(OFFBOARD)

    def until_attitude(self, roll_deg, pitch_deg, seconds=20.0, hold=2.0):
        """Goes on until ATTITUDE has been near for two seconds, with ATTITUDE_TARGET at it."""
        end, since, target, last = time.monotonic() + seconds, None, None, None
        while time.monotonic() < end:
            for message in self.turn():
                if message.get_type() == "ATTITUDE_TARGET":
                    target = roll_pitch(message.q)
                if message.get_type() == "ATTITUDE":
                    last = (math.degrees(message.roll), math.degrees(message.pitch))
                    near = max(abs(last[0] - roll_deg), abs(last[1] - pitch_deg)) <= NEAR_DEG
                    since = (since or time.monotonic()) if near else None
            if since and time.monotonic() - since >= hold:
                check(target is not None, "no ATTITUDE_TARGET was streamed")
                off = max(abs(target[0] - roll_deg), abs(target[1] - pitch_deg))
                check(off < 0.01, f"ATTITUDE_TARGET is {target}")
                say(f"attitude {last[0]:.3f} / {last[1]:.3f} deg for {roll_deg:g} / {pitch_deg:g}")
                return
        raise Failure(f"attitude {last} for {roll_deg:g} / {pitch_deg:g} after {seconds:g} s")
