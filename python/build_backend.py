"""The build backend maturin with ``--ignore-rust-version``: the crate jsbsim builds with an older Rust than it declares."""

import os

from maturin import *  # noqa: F403

_FLAG = "--ignore-rust-version"
if _FLAG not in os.environ.get("MATURIN_PEP517_ARGS", ""):
    os.environ["MATURIN_PEP517_ARGS"] = f"{os.environ.get('MATURIN_PEP517_ARGS', '')} {_FLAG}".strip()
