"""A flight with pymavlink: parameters, arming, OFFBOARD, an attitude, HOLD, disarming."""

import flight
from flight import PITCH_DEG, ROLL_DEG, check, say
from offboard import ARM, FORCE, HOLD, OFFBOARD, SET_MODE, Offboard, mavlink


def read_parameters(client):
    """All parameters by the list, as ground stations do."""
    table = {}
    client.link.param_fetch_all()

    def complete(message):
        if message.get_type() == "PARAM_VALUE":
            table[message.param_index] = message
            return len(table) == message.param_count
        return False

    client.until(complete, "complete parameter list", 10.0)
    names = [table[index].param_id for index in sorted(table)]
    check(len(set(names)) == len(names), f"names repeat: {names}")
    say(f"{len(names)} parameters: {', '.join(names)}")
    return {message.param_id: message for message in table.values()}


def set_parameter(client, name, value):
    """Sets a parameter; the value that is in force according to the echo."""
    client.mark()
    client.link.param_set_send(name, value)
    message = client.until(
        lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name, f"echo of {name}"
    )
    return message.param_value


def set_parameters(client, table):
    """One value that is taken, one that is refused, one name that is not known."""
    name = "GL_BANK_MAX_DEG"
    before = table[name].param_value
    check(set_parameter(client, name, before - 5.0) == before - 5.0, f"{name} was not set")
    check(set_parameter(client, name, 500.0) == before - 5.0, "a bank of 500 degrees was taken")
    client.until_text(f"{name} refused")
    check(set_parameter(client, name, before) == before, f"{name} was not set back")
    client.mark()
    client.link.param_set_send("NO_SUCH_THING", 1.0)
    client.until_text("NO_SUCH_THING refused")


def main():
    """Flies."""
    arguments = flight.arguments(__doc__)
    port = flight.free_ports(1)[0]
    with flight.Flight(arguments, [f"udpin:127.0.0.1:{port}"]) as flown:
        say(f"connecting pymavlink to udpout:127.0.0.1:{port}")
        client = Offboard(f"udpout:127.0.0.1:{port}")
        set_parameters(client, read_parameters(client))

        say("OFFBOARD without arming, then without setpoints")
        refused = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        check(client.command(SET_MODE, 1, *OFFBOARD) == refused, "OFFBOARD while disarmed")
        client.until_text("arm first")
        client.arm()
        check(client.command(SET_MODE, 1, *OFFBOARD) == refused, "OFFBOARD without setpoints")
        client.until_text("send setpoints first")

        say(f"OFFBOARD to {ROLL_DEG:g} / {PITCH_DEG:g} degrees")
        client.engage(ROLL_DEG, PITCH_DEG)
        client.until_attitude(ROLL_DEG, PITCH_DEG)

        say("HOLD")
        check(client.command(SET_MODE, 1, *HOLD) == mavlink.MAV_RESULT_ACCEPTED, "HOLD was refused")
        client.until_mode(HOLD)
        client.target = None
        client.until(
            lambda m: m.get_type() == "ATTITUDE" and abs(m.roll) < 0.01, "level wings in HOLD", 10.0
        )

        say("disarming in flight: refused, then forced")
        check(client.command(ARM, 0) == refused, "disarming in flight was not refused")
        check(
            client.command(ARM, 0, FORCE) == mavlink.MAV_RESULT_ACCEPTED, "forced disarming failed"
        )
        standby = mavlink.MAV_STATE_STANDBY
        client.until(
            lambda m: m.get_type() == "HEARTBEAT" and m.system_status == standby, "standby"
        )
        client.link.close()
        flown.land()


flight.run(main, 120)
