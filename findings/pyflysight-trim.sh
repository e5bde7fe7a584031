#!/usr/bin/env bash
# pyflysight 0.10.0 (October 2026), logs of the FlySight 2, a recorder with GNSS, IMU and barometer: trim_log() takes the streams apart. Before it all of them have one time axis (`elapsed_time`, of the track `elapsed_time_sensor`), which the
# package has worked out from the recorder's records of GPS time. After it each stream begins at zero with its own first sample: what was between the start of the window and that sample is lost, for each stream another amount.
# GNSS comes last, as it has to find satellites: in a log whose track begins 25 s after the sensors, trimmed from 10 s on, the opening of a parachute is at 50 s by the accelerometer and at 35 s by the track. With a window that begins when all
# of them run it is a fraction of a sample of the slowest, up to 0.1 s for a track of 5 Hz; with one that begins in a gap of the reception, 4 s of the 10 s without satellites, the time to the nearest sample on either side of it.
# Why it matters: trimming the minutes in the aircraft off is the first step with such a log, and what comes next is to lay the accelerations over the track, for a drag polar or to check an estimator. What is saved with to_csv() has the
# broken axis; the interactive `pyflysight trim` calls the same function, and by the pressure altitude, the one that it shows, all looks right.
# Source: FlysightV2FlightLog.trim_log() in flysight_proc.py subtracts df["elapsed_time"][0] of each stream. The documentation: "The elapsed time column is re-normalized to the provided trim window."
# Instead: filter each stream by its own axis (filter(pl.col("elapsed_time").is_between(a, b))) and subtract the start of the window from all of them.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile polars==2.1.0 && "$folder/v/bin/pip" -q install --no-compile --no-deps pyflysight==0.10.0
cd "$folder"
POLARS_MAX_THREADS=1 v/bin/python - <<'PYTHON'
import datetime
from importlib.metadata import version
from pathlib import Path

import polars as pl
from pyflysight.flysight_proc import parse_v2_log_directory

BOOT, OPENING, G = 59970.5, 60.0, 9.80665   # the recorder's clock at the first record; seconds after it, at which the parachute opens and pulls with 2 g for a second
START = datetime.datetime(2026, 6, 20, 14, 0, tzinfo=datetime.timezone.utc)
WEEK, TOW = divmod((START - datetime.datetime(1980, 1, 6, tzinfo=datetime.timezone.utc)).total_seconds(), 7 * 86400)
HEAD = "$FLYS,1\n$VAR,FIRMWARE_VER,v2024.05.25\n$VAR,DEVICE_ID,0\n$VAR,SESSION_ID,0\n"

def write(folder, received):
    """A log of 120 s; `received(t)` tells whether there is a position at that time."""
    folder.mkdir()
    records = []
    for i in range(120 * 50):
        t = i / 50
        pull = 2 if OPENING <= t < OPENING + 1 else 1
        records.append((t, f"$IMU,{BOOT + t:.3f},0,0,0,0,0,{pull:.3f},25.0"))
    for i in range(120 * 10):
        records.append((i / 10 + 0.031, f"$BARO,{BOOT + i / 10 + 0.031:.3f},70000.0,10.0"))
    for i in range(12):
        records.append((i * 10 + 0.5, f"$TIME,{BOOT + i * 10 + 0.5:.3f},{TOW + i * 10 + 0.5:.3f},{WEEK:.0f}"))
    columns = {"IMU": ("time,wx,wy,wz,ax,ay,az,temperature", "s,deg/s,deg/s,deg/s,g,g,g,deg C"), "BARO": ("time,pressure,temperature", "s,Pa,deg C"), "TIME": ("time,tow,week", "s,s,")}
    (folder / "SENSOR.CSV").write_text(HEAD + "".join(f"$COL,{name},{labels}\n$UNIT,{name},{units}\n" for name, (labels, units) in columns.items()) + "$DATA\n" + "\n".join(line for _, line in sorted(records)) + "\n")
    track = []
    for i in range(120 * 5):
        t = i / 5 + 0.12
        if received(t):
            down = 50 - G * min(max(t - OPENING, 0), 1)
            stamp = (START + datetime.timedelta(seconds=t)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
            track.append(f"$GNSS,{stamp},47.0,11.0,{4000 - 50 * t:.3f},10.0,0.0,{down:.3f},1.0,1.5,0.3,14")
    (folder / "TRACK.CSV").write_text(HEAD + "$COL,GNSS,time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,numSV\n$UNIT,GNSS,,deg,deg,m,m/s,m/s,m/s,m,m,m/s,\n$DATA\n" + "\n".join(track) + "\n")
    return folder

def opening(imu, track):
    """When the parachute opens, by the accelerometer and by the velocity of the track."""
    pulled = imu.filter(pl.col("total_accel") > 1.5)["elapsed_time"][0]
    return pulled, track.filter(pl.col("velD") < 49.99)["elapsed_time_sensor"][0]

print("pyflysight", version("pyflysight"), "- the parachute opens at 60.0 s, the track has 5 Hz")
for name, received, begin, least, most in (("first position after 25 s, trimmed from 10 s", lambda t: t >= 25, 10, 14.7, 15.3), ("the same, trimmed from 30 s", lambda t: t >= 25, 30, -0.11, 0.11),
                                           ("no position from 20 to 30 s, trimmed from 26 s", lambda t: not 20 <= t < 30, 26, 3.8, 4.4)):
    log = parse_v2_log_directory(write(Path(name.replace(" ", "_").replace(",", "")), received))
    before = opening(log.sensor_data["IMU"], log.track_data)
    mine = [frame.filter(pl.col(axis).is_between(begin, 100)).with_columns(pl.col(axis) - begin) for frame, axis in ((log.sensor_data["IMU"], "elapsed_time"), (log.track_data, "elapsed_time_sensor"))]
    log.trim_log(begin, 100)
    after, right = opening(log.sensor_data["IMU"], log.track_data), opening(*mine)
    print(f"{name:47}: by accelerometer and track {before[0]:.2f} and {before[1]:.2f} s before, {after[0]:.2f} and {after[1]:.2f} s after trim_log(), {right[0]:.2f} and {right[1]:.2f} s if the window's start is subtracted")
    offset = (after[0] - after[1]) - (before[0] - before[1])
    assert abs(before[0] - OPENING) < 0.03 and 0 <= before[1] - OPENING < 0.35 and least < offset < most, offset
    assert abs(right[0] - (OPENING - begin)) < 0.03 and abs((right[1] - right[0]) - (before[1] - before[0])) < 1e-6
PYTHON
