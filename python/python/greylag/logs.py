"""Converts MATLAB files to the CSV that ``greylag logs`` reads."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

#: Message for a variable of a class that only MATLAB can read, with the MATLAB line that exports it.
_OPAQUE = (
    "{name} is an object of MATLAB's class {kind}, which nothing but MATLAB reads: in MATLAB, "
    'writetimetable({name}, "log.csv") writes it (writetable for a table, timeseries2timetable before it for a timeseries)'
)


class _Opaque:
    """A variable of the MATLAB class ``kind``, which only MATLAB can read."""

    def __init__(self, kind: str) -> None:
        self.kind = kind


def mat_to_csv(
    path: str | os.PathLike[str], out: str | os.PathLike[str], names: Mapping[str, str] | None = None
) -> list[str]:
    """Write the signals of a MATLAB file to the CSV ``out``, one row per sample, and return the names of its columns.

    A signal is a numeric vector. A vector in a struct has a dotted name: ``flight.imu.p``, or ``imu[0].p`` in an array of
    structs. A matrix has its samples along its longer dimension (along its rows if it is square): an N×4 and a 4×N matrix
    both have N samples of the signals ``q[0]`` to ``q[3]``. Files of versions 4 to 7 need scipy. Files of version 7.3 and
    other HDF5 files need h5py.

    ``names`` maps the columns of the CSV to signals: ``{"time_s": "flight.t", "roll_rad": "flight.att[0]"}``. Without
    ``names``, the most frequent length of the signals is determined, and all signals of this length are written under
    their own names. A mapping file then refers to them as ``csv.NAME``. A warning lists the variables that are left out.
    The values are not rescaled.

    Raises ``ValueError`` if a name is not in the file, if the named signals differ in length, or if there is no signal.
    Raises ``ImportError`` if scipy or h5py is needed and not installed.
    """
    path = os.fspath(path)
    signals: dict[str, np.ndarray] = {}
    left_out: dict[str, str] = {}
    for name, value in _variables(path).items():
        _flatten(name, value, signals, left_out)
    if not signals:
        why = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "it is empty"
        raise ValueError(f"{path} holds no numeric vector: {why}")
    columns = _most(signals, left_out) if names is None else _named(path, signals, left_out, names)
    if names is None and left_out:
        listed = "; ".join(f"{name}: {why}" for name, why in left_out.items())
        warnings.warn(f"{path}: {len(left_out)} variables are left out: {listed}", stacklevel=2)
    pd.DataFrame(columns).to_csv(out, index=False)
    return list(columns)


def _named(
    path: str, signals: dict[str, np.ndarray], left_out: dict[str, str], names: Mapping[str, str]
) -> dict[str, np.ndarray]:
    """The columns that ``names`` defines. Their lengths are equal."""
    for name in names.values():
        if name not in signals:
            why = left_out.get(name) or f"it holds {', '.join(sorted(signals))}"
            raise ValueError(f"{path} has no signal {name}: {why}")
    columns = {column: signals[name] for column, name in names.items()}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        listed = ", ".join(f"{name} {len(signals[name])}" for name in names.values())
        raise ValueError(
            f"{path}: the signals have different numbers of samples ({listed}): bring them to one time in MATLAB "
            "(interp1, synchronize), or write a CSV for each time"
        )
    return columns


def _most(signals: dict[str, np.ndarray], left_out: dict[str, str]) -> dict[str, np.ndarray]:
    """The signals of the most frequent length; of two equally frequent lengths, the greater one.

    The other signals are added to ``left_out`` with the reason.
    """
    counts = Counter(len(values) for values in signals.values())
    length = max(counts, key=lambda n: (counts[n], n))
    for name, values in signals.items():
        if len(values) != length:
            left_out[name] = f"{len(values)} samples, not {length} as most have"
    return {name: values for name, values in signals.items() if len(values) == length}


def _flatten(name: str, value: Any, signals: dict[str, np.ndarray], left_out: dict[str, str]) -> None:
    """Add the vectors in a variable to ``signals``, and everything else to ``left_out`` with the reason."""
    if isinstance(value, _Opaque):
        left_out[name] = _OPAQUE.format(name=name, kind=value.kind)
    elif isinstance(value, Mapping):
        for field, inner in value.items():
            _flatten(f"{name}.{field}", inner, signals, left_out)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            _flatten(f"{name}[{i}]", inner, signals, left_out)
    elif not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        left_out[name] = "not numeric"
    elif value.size < 2:
        left_out[name] = "no vector but a single value" if value.size else "empty"
    elif value.ndim == 1 or sorted(value.shape)[-2] == 1:
        signals[name] = value.reshape(-1).astype(float)
    elif value.ndim == 2:
        samples = value if value.shape[0] >= value.shape[1] else value.T
        for i in range(samples.shape[1]):
            signals[f"{name}[{i}]"] = samples[:, i].astype(float)
    else:
        left_out[name] = f"an array of {value.ndim} dimensions"


def _variables(path: str) -> dict[str, Any]:
    """The variables of a file by name. Structs are mappings, and arrays of structs are lists."""
    with open(path, "rb") as file:
        start = file.read(520)
    if start.startswith(b"\x89HDF\r\n") or start[512:518] == b"\x89HDF\r\n":
        return _hdf5(path)
    return _mat5(path)


def _mat5(path: str) -> dict[str, Any]:
    try:
        from scipy.io import loadmat
        from scipy.io.matlab import MatlabFunction, MatlabOpaque, mat_struct
    except ImportError as error:
        raise ImportError(f"{path} is a MATLAB file, which scipy reads: pip install scipy") from error
    try:
        loaded = loadmat(path, struct_as_record=False, squeeze_me=False)
    except (ValueError, TypeError, NotImplementedError, OSError, EOFError) as error:
        raise ValueError(f"{path} cannot be read as a MATLAB file: {error}") from error

    def plain(value: Any) -> Any:
        if isinstance(value, MatlabOpaque):
            kinds = [part for part in value.reshape(-1)[0].tolist() if isinstance(part, bytes)]
            return _Opaque(kinds[-1].decode(errors="replace") if kinds else "unknown")
        if isinstance(value, MatlabFunction):
            return None
        if isinstance(value, mat_struct):
            return {field: plain(getattr(value, field)) for field in value._fieldnames}
        if isinstance(value, np.ndarray) and value.dtype == object:
            inner = [plain(item) for item in value.reshape(-1)]
            structs = all(isinstance(item, dict) for item in inner)
            return inner[0] if structs and len(inner) == 1 else inner if structs else None
        return value

    def opaque_name(name: str, value: Any) -> str:
        # scipy stores the name of such a variable in its value
        first = value.reshape(-1)[0].tolist()[0] if isinstance(value, MatlabOpaque) else b""
        return first.decode(errors="replace") if isinstance(first, bytes) and first else name

    return {opaque_name(name, value): plain(value) for name, value in loaded.items() if not name.startswith("__")}


def _hdf5(path: str) -> dict[str, Any]:
    try:
        import h5py
    except ImportError as error:
        raise ImportError(f"{path} is a MATLAB file of version 7.3, which h5py reads: pip install h5py") from error

    def plain(item: Any) -> Any:
        kind = item.attrs.get("MATLAB_class", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if "MATLAB_object_decode" in item.attrs:
            return _Opaque(kind)
        if isinstance(item, h5py.Group):
            return {name: plain(inner) for name, inner in item.items()}
        if kind in ("char", "cell", "function_handle", "struct") or "MATLAB_empty" in item.attrs:
            return None
        value = item[()]
        # MATLAB stores the dimensions in reverse order
        return np.asarray(value).T if kind else np.asarray(value)

    with h5py.File(path, "r") as file:
        return {name: plain(item) for name, item in file.items() if not name.startswith("#")}
