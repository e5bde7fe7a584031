"""The model that a case is given: the truth's, every coefficient off, less what is hidden."""

import numpy as np

import aircraft as x8
from hidden import TAKEN_OUT

WRONG = 0.10
"""How wrong coefficients are: standard deviation as a share of the value, none beyond twice.

The widths that a model file states by default are 15 %.
"""


def coefficients(effect, random, wrong=WRONG):
    """Coefficients by effect and name, off by `wrong`, without what `effect` takes out."""
    out = {}
    for part, names in x8.COEFFICIENTS.items():
        names = dict(names)
        if part == "lift_linear" and effect == "lift_stall":
            names.update(x8.LINEAR_LIFT)
        off = {n: 1.0 + wrong * np.clip(random.standard_normal(), -2.0, 2.0) for n in names}
        if part != TAKEN_OUT.get(effect):
            out[part] = {n: float(f"{v * off[n]:.5g}") for n, v in names.items()}
    return out


def text(name, parts, integrator="rk4"):
    """The text of the model file."""
    lines = [
        "schema = 1",
        f'name = "{name}"',
        'description = "A model whose coefficients are guesses, and which may lack an effect."',
        'airframe = "airframe.toml"',
        f'integrator = "{integrator}"',
        'force_axes = "wind"',
        "",
        "[rigid_body]",
        *(number(n, v) for n, v in _body().items()),
        "",
        "[air]",
        number("gravity_mps2", x8.GRAVITY),
        'density = "standard"',
    ]
    for part, names in parts.items():
        lines += ["", f"[effects.{part}]", *(number(n, v) for n, v in names.items())]
        if part in _TABLES:
            ordinate, alphas, values = _TABLES[part]
            lines += ["", f"[effects.{part}.{ordinate}]", f"alpha_rad = {list(alphas)}", f"value = {list(values)}"]
            lines += ['source = "the truth\'s"']
    return "\n".join(lines) + "\n"


_TABLES = {
    "lift_table": ("CL", x8.LIFT_ALPHA, x8.LIFT),
    "drag_table": ("CD", x8.DRAG_ALPHA, x8.DRAG),
}


def number(name, value):
    """One number with its source."""
    return f'{name} = {{ value = {value!r}, source = "a guess" }}'


def _body():
    return {
        "mass_kg": x8.MASS, "jx_kgm2": x8.JX, "jy_kgm2": x8.JY, "jz_kgm2": x8.JZ, "jxz_kgm2": x8.JXZ,
    }  # fmt: skip
