"""pymavlink through the routing companion: Greylag flies PX4 and ArduPilot, played by the shim."""

import flight
from flight import PITCH_DEG, ROLL_DEG, check, say
from offboard import ARM, FORCE, Offboard, mavlink

# The numbers of the modes in which each stack is steered, and has the aircraft itself.
MODES = {"px4": (1 << 16, 4 << 16 | 3 << 24), "ardupilot": (0, 12)}


def controller_in(client, number, what):
    """Waits for the controller's own heartbeat in a mode."""

    def shows(message):
        sender = (message.get_srcSystem(), message.get_srcComponent())
        return message.get_type() == "HEARTBEAT" and sender == (1, 1) and message.custom_mode == number

    client.mark()
    client.until(shows, f"the controller in {what}", 5.0)


def fly(arguments, stack):
    """Engages Greylag beside a controller, flies an attitude, gives the aircraft back."""
    steered, hold = MODES[stack]
    port = flight.free_ports(1)[0]
    with flight.Flight(arguments, [f"udpin:127.0.0.1:{port}"], stack) as flown:
        client = Offboard(f"udpout:127.0.0.1:{port}", pilot=(1, 191))
        # An onboard computer streams what it is asked for.
        for message_id in [mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET]:
            result = client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 50_000)
            check(result == mavlink.MAV_RESULT_ACCEPTED, f"interval of {message_id}: {result}")
        # Rates are measured over a second before the aircraft is taken.
        client.run(3.0)
        client.arm()
        client.engage(ROLL_DEG, PITCH_DEG)
        controller_in(client, steered, "the mode that is steered")
        client.until_attitude(ROLL_DEG, PITCH_DEG)
        result = client.command(ARM, 0, FORCE)
        check(result == mavlink.MAV_RESULT_ACCEPTED, f"giving it back: {result}")
        controller_in(client, hold, "its own mode again")
        client.link.close()
        flown.land()
    say(f"{stack}: flown and given back")


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    for stack in MODES:
        fly(arguments, stack)


flight.run(main, 150)
