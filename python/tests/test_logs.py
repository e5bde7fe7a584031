"""MATLAB files of all versions are converted to CSV. For an object that only MATLAB reads, the error names an export line."""

from __future__ import annotations

import struct
import sys

import numpy as np
import pandas as pd
import pytest

from greylag.logs import mat_to_csv

T = np.arange(500) * 0.01
FLIGHT = {"t": T, "att": np.column_stack([np.sin(T), 0.1 * np.cos(T), T]), "imu": {"p": np.cos(T)}, "mass": 3.0}


def mat5(path, **variables):
    """Writes a MATLAB file of version 5."""
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(path, variables)
    return path


def mat73(path, **variables):
    """Writes a MATLAB file of version 7.3: HDF5 after 512 bytes, with reversed dimensions and the class of each variable."""
    h5py = pytest.importorskip("h5py")

    def put(group, name, value):
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for field, item in value.items():
                put(inner, field, item)
            return
        value = np.atleast_2d(value) if np.ndim(value) != 1 else np.reshape(value, (-1, 1))
        group.create_dataset(name, data=value.T).attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))
    return path


@pytest.mark.parametrize("write", [mat5, mat73])
def test_named_signals_are_written_as_they_are(write, tmp_path):
    path = write(tmp_path / "flight.mat", flight=FLIGHT)
    names = {"time_s": "flight.t", "roll_rad": "flight.att[0]", "p_radps": "flight.imu.p"}
    assert mat_to_csv(path, tmp_path / "out.csv", names) == list(names)
    table = pd.read_csv(tmp_path / "out.csv")
    for column, exact in zip(names, (T, np.sin(T), np.cos(T)), strict=True):
        np.testing.assert_array_equal(table[column], exact)


@pytest.mark.parametrize("write", [mat5, mat73])
def test_without_names_all_of_one_length_are_written_and_the_others_named(write, tmp_path):
    path = write(tmp_path / "flight.mat", flight=FLIGHT, gps=T[:50], note=np.zeros((2, 2, 2)))
    with pytest.warns(UserWarning, match="3 variables are left out") as said:
        columns = mat_to_csv(path, tmp_path / "out.csv")
    assert sorted(columns) == ["flight.att[0]", "flight.att[1]", "flight.att[2]", "flight.imu.p", "flight.t"]
    text = str(said[0].message)
    assert "gps: 50 samples, not 500" in text and "flight.mass" in text and "note" in text


@pytest.mark.parametrize("write", [mat5, mat73])
def test_a_matrix_with_a_signal_in_each_row_is_read_like_its_transpose(write, tmp_path):
    path = write(tmp_path / "flight.mat", flight=FLIGHT | {"att": FLIGHT["att"].T})
    columns = mat_to_csv(path, tmp_path / "out.csv", {"time_s": "flight.t", "yaw_rad": "flight.att[2]"})
    assert columns == ["time_s", "yaw_rad"]
    np.testing.assert_array_equal(pd.read_csv(tmp_path / "out.csv")["yaw_rad"], T)


def test_arrays_of_structs_have_numbers(tmp_path):
    both = np.array([(T,), (2 * T,)], dtype=[("p", object)])
    path = mat5(tmp_path / "two.mat", imu=both, words="text", cells=np.array(["a", "b"], dtype=object))
    assert mat_to_csv(path, tmp_path / "out.csv", {"a": "imu[0].p", "b": "imu[1].p"}) == ["a", "b"]
    np.testing.assert_array_equal(pd.read_csv(tmp_path / "out.csv")["b"], 2 * T)


def test_wrong_names_and_lengths_are_refused(tmp_path):
    path = mat5(tmp_path / "flight.mat", t=T, gps=T[:50])
    with pytest.raises(ValueError, match="no signal roll: it holds gps, t"):
        mat_to_csv(path, tmp_path / "out.csv", {"roll_rad": "roll"})
    with pytest.raises(ValueError, match=r"different numbers of samples \(t 500, gps 50\)"):
        mat_to_csv(path, tmp_path / "out.csv", {"time_s": "t", "vn_mps": "gps"})
    (tmp_path / "other.mat").write_bytes(b"no MATLAB file, but long enough to be taken for one" * 9)
    with pytest.raises(ValueError, match="cannot be read as a MATLAB file|holds no numeric vector"):
        mat_to_csv(tmp_path / "other.mat", tmp_path / "out.csv")


def timetable5(path):
    """Writes a version 5 file with an object of the class timetable. As in MATLAB, it is a reference to a hidden element."""

    def element(kind, body):
        return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)

    def matrix(cls, *parts):
        return element(14, element(6, struct.pack("<II", cls, 0)) + b"".join(parts))

    reference = matrix(13, element(5, struct.pack("<ii", 6, 1)), element(1, b""), element(6, struct.pack("<6I", *range(6))))
    opaque = matrix(17, element(1, b"log"), element(1, b"MCOS"), element(1, b"timetable"), reference)
    head = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(116) + b"\0" * 8 + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + opaque)
    return path


def timetable73(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("log", data=np.arange(6, dtype=np.uint32).reshape(1, 6))
        data.attrs["MATLAB_class"] = np.bytes_("timetable")
        data.attrs["MATLAB_object_decode"] = np.int32(3)
    return path


@pytest.mark.parametrize("write", [timetable5, timetable73])
def test_a_timetable_is_named_with_the_line_that_writes_it(write, tmp_path):
    pytest.importorskip("scipy")
    path = write(tmp_path / "log.mat")
    with pytest.raises(ValueError, match=r"class timetable.*writetimetable\(log"):
        mat_to_csv(path, tmp_path / "out.csv")


@pytest.mark.parametrize(("write", "module"), [(mat5, "scipy.io"), (mat73, "h5py")])
def test_what_is_not_installed_is_named(write, module, tmp_path, monkeypatch):
    path = write(tmp_path / "flight.mat", t=T)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=f"pip install {module.split('.')[0]}"):
        mat_to_csv(path, tmp_path / "out.csv")
