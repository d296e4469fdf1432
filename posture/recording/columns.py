"""From the columns of a file to the signals of a `Recording`: which column is what, in which unit, with which sign.

The signs here are those of the simulated body: hip flexion is negative, and so is the ankle when the body leans forward
(dorsiflexion); x points forward. OpenSim's gait models and Plug-in Gait count both positive. With either convention a
positive correlation of hip and ankle is in-phase; with one that counts flexion positive and dorsiflexion negative it would
be anti-phase, which `scale.ankle=-1` corrects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from envs.body.joints import JOINTS
from posture.analysis.trajectory import Array
from posture.config.analyse import AnalyseConfig
from posture.config.errors import ConfigError
from posture.recording.formats import read_table
from posture.recording.table import Table, name_and_unit, refuse

SIDES = ("left", "right")
SIGN = {"posture": 1.0, "opensim": -1.0}
"""Factor into our signs of an angle in each convention."""
KNOWN_ANGLES: dict[str, dict[str, dict[str, str]]] = {
    "hip": {
        "left": {"hip_left_angle": "posture", "hip_flexion_l": "opensim", "LHipAngles.x": "opensim"},
        "right": {"hip_right_angle": "posture", "hip_flexion_r": "opensim", "RHipAngles.x": "opensim"},
    },
    "ankle": {
        "left": {"ankle_left_angle": "posture", "ankle_angle_l": "opensim", "LAnkleAngles.x": "opensim"},
        "right": {"ankle_right_angle": "posture", "ankle_angle_r": "opensim", "RAnkleAngles.x": "opensim"},
    },
}
"""Names of joint angles: joint, side, name, convention. Of our own export, OpenSim's gait models, and Plug-in Gait."""
KNOWN = {"time": ("time", "t"), "head": ("head_x",), "target": ("target_x",)}
"""Names of other signals."""
SIMULATED = {
    "head_vx": "length",
    **{f"{joint}_velocity": "angle" for joint in JOINTS},
    **{f"{joint}_torque": "" for joint in JOINTS},
    "cop_x": "length",
    "foot_loaded": "",
    "foot_flat": "",
    "foot_displacement": "length",
}
"""Signals that only our own export has, by name, with the kind of their unit; read where all of them are there."""

_FACTOR = {
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001},
    "time": {"s": 1.0, "ms": 0.001},
}
"""Into SI units."""
SLOW = 0.5
"""No recording of a stander has samples this far apart [s]; times that are have another unit, or are numbers of frames."""
LARGEST = {"angle": 10.0, "length": 5.0}
"""What no recording of a stander reaches: an angle [rad], or the distance of a position from its median [m]."""
JUMP = math.pi
"""What no joint turns from one sample to the next [rad]."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial of one person; T samples.

    time: increasing [s], (T,). hip, ankle: angles [rad], flexion and dorsiflexion negative, mean of the sides, (T,). head,
    target: forward positions [m], (T,), None where there are none. simulated: the signals of `SIMULATED` in SI units, (T,)
    each; empty unless our export wrote the file. nan where a value is missing.
    """

    path: Path
    time: Array
    hip: Array
    ankle: Array
    head: Array | None
    target: Array | None
    simulated: Mapping[str, Array]


def read_recording(path: Path, config: AnalyseConfig) -> Recording:
    """The recording in a file, with the columns, units and signs that `config` or the file names. Raises ConfigError, which
    names the file and, of a single value, its row and column."""
    table = read_table(path)
    places = _all_places(table, config)
    lower = [name.lower() for name in table.names]
    simulated = [lower.index(name) for name in SIMULATED] if set(SIMULATED) <= set(lower) else []
    wanted = sorted({place for group in places.values() for place in group} | set(simulated))
    values = table.values(wanted)
    if places["time"]:
        # OpenSim may write a row twice. Nothing is lost with the second one.
        kept = np.concatenate([[True], (values[1:] != values[:-1]).any(axis=1)])
        table, values = replace(table, rows=table.rows[kept]), values[kept]
    found = dict(zip(wanted, values.T, strict=True))
    for place, signal in found.items():
        if len(infinite := np.flatnonzero(np.isinf(signal))):
            raise ConfigError(f"{table.place(int(infinite[0]), place)}: infinite")
    signals = {name: _signal(table, found, own, name, config) for name, own in places.items() if own and name != "time"}
    return Recording(
        path=table.path,
        time=_time(table, found, places["time"], config),
        hip=signals["hip"],
        ankle=signals["ankle"],
        head=signals.get("head"),
        target=signals.get("target"),
        simulated=_simulated(table, found, simulated, config),
    )


def _all_places(table: Table, config: AnalyseConfig) -> dict[str, list[int]]:
    """The columns of each signal. Raises ConfigError where there are none of the hip, the ankle or the time."""
    places = {name: _angle_places(table, name, config) for name in KNOWN_ANGLES}
    places |= {name: _places(table, name, config) for name in KNOWN}
    there = f"there are {_some(table.names)}"
    for name in KNOWN_ANGLES:
        if not places[name]:
            sides = SIDES if config.side == "both" else (config.side,)
            known = ", ".join(one for side in sides for one in KNOWN_ANGLES[name][side])
            raise refuse(table.path, f"no column of the {name} angle; columns.{name}= names it (known: {known}; {there})")
    if config.rate is None and table.rate is None and not places["time"]:
        raise refuse(table.path, f"no column of times; columns.time= names it, or rate= the sampling rate [Hz] ({there})")
    return places


def _signal(table: Table, found: Mapping[int, Array], places: Sequence[int], name: str, config: AnalyseConfig) -> Array:
    """An angle [rad] or position [m] in our signs, the mean of its columns. Raises ConfigError where it has no number."""
    columns = []
    for place in places:
        if name in KNOWN_ANGLES:
            columns.append(_in_si(table, found[place], place, "angle", name, config) * _sign(table, place, name, config))
        else:
            columns.append(_in_si(table, found[place], place, "length", name, config))
    mean = np.asarray(sum(columns[1:], columns[0]) / len(columns))  # nan where one of them is
    if not np.isfinite(mean).any():
        raise refuse(table.path, f"the column of the {name}, {table.names[places[0]]}, has no numbers")
    return mean * float(getattr(config.scale, name))


def _angle_places(table: Table, joint: str, config: AnalyseConfig) -> list[int]:
    """The columns of an angle, whose mean it is."""
    if getattr(config.columns, joint) is not None:
        return _places(table, joint, config)
    sides = SIDES if config.side == "both" else (config.side,)
    return [place for side in sides for place in _known(table, KNOWN_ANGLES[joint][side], f"{side} {joint} angle", joint)]


def _places(table: Table, name: str, config: AnalyseConfig) -> list[int]:
    """The columns of a signal: those that `columns` names, or the one with a known name, if any."""
    given = getattr(config.columns, name)
    if given is None:
        return _known(table, KNOWN[name], name, name) if table.rate is None or name != "time" else []
    return [_place(table, one, name) for one in given]


def _place(table: Table, wanted: str, name: str) -> int:
    """The column that a user names, with or without its unit."""
    own = name_and_unit(wanted)[0]
    for match in (
        [i for i, one in enumerate(table.names) if one in (wanted, own)],
        [i for i, one in enumerate(table.names) if one.lower() in (wanted.lower(), own.lower())],
    ):
        if len(match) > 1:
            raise refuse(table.path, f"{len(match)} columns are called {wanted}, which columns.{name} names")
        if match:
            return match[0]
    there = sorted(table.names, key=lambda one: own.lower() not in one.lower())  # similar names first
    raise refuse(table.path, f"no column {wanted}, which columns.{name} names; there are {_some(there)}")


def _known(table: Table, names: Sequence[str] | Mapping[str, str], what: str, key: str) -> list[int]:
    """The column that has one of the known names, as a list; [] without one. Raises ConfigError if there are several."""
    wanted = {name.lower() for name in names}
    match = [i for i, name in enumerate(table.names) if known_name(name) in wanted]
    if len(match) > 1:
        both = " and ".join(table.names[i] for i in match[:2])
        raise refuse(table.path, f"{both} could both be the {what}; columns.{key}= names the one to be used")
    return match


def known_name(name: str) -> str:
    """A column's name for comparison with the known ones, in small letters: "/jointset/hip_r/hip_flexion_r/value" of
    OpenSim 4 is hip_flexion_r, and "Anna:RHipAngles.x" of Vicon is rhipangles.x."""
    parts = name.strip().split("/")
    last = parts[-2] if len(parts) > 2 and parts[-1] == "value" else name.strip()
    return last.rpartition(":")[2].lower()


def _in_si(table: Table, signal: Array, place: int, kind: str, name: str, config: AnalyseConfig) -> Array:
    """A column in rad or m. Raises ConfigError where its unit is not known, or cannot be right."""
    asked = _typed_unit(table, place, name, config) or (config.angle_unit if kind == "angle" else config.length_unit)
    unit = asked or table.units[place] or table.units_of.get(kind)
    if unit is not None and unit not in _FACTOR[kind]:
        example = f"columns.{name}='{table.names[place]} [{'m' if kind == 'length' else 'deg'}]'"
        raise refuse(
            table.path,
            f"column {table.names[place]}, the {name}, is in {unit}; allowed are {', '.join(_FACTOR[kind])}; "
            f'"{example}" sets the unit, and scale.{name}= the factor into it',
        )
    if unit is None:
        allowed = " or ".join(f"{kind}_unit={one}" for one in _FACTOR[kind])
        raise refuse(table.path, f"nothing says the unit of column {table.names[place]}, the {name}; {allowed} does")
    converted = signal * _FACTOR[kind][unit]
    size = np.abs(converted) if kind == "angle" else np.abs(converted - _median(converted))
    if np.nanmax(size, initial=0.0) > LARGEST[kind]:
        sample = int(np.nanargmax(size))
        much = "is more than 10 rad" if kind == "angle" else "is more than 5 m from the median"
        raise ConfigError(f"{table.place(sample, place)}: {signal[sample]:g} {unit} {much}; {kind}_unit= sets another unit")
    if kind == "angle" and len(jumps := np.flatnonzero(np.abs(np.diff(converted)) > JUMP)):
        sample = int(jumps[0]) + 1
        raise ConfigError(
            f"{table.place(sample, place)}: jumps from {signal[sample - 1]:g} to {signal[sample]:g} {unit}; allowed are "
            "angles that do not begin again after a full turn, and an empty cell or nan where a value is missing"
        )
    return converted


def _typed_unit(table: Table, place: int, name: str, config: AnalyseConfig) -> str:
    """The unit that `columns` has behind the name of a column, "" without one."""
    for one in getattr(config.columns, name, None) or ():
        if (unit := name_and_unit(one)[1]) and _place(table, one, name) == place:
            return unit
    return ""


def _median(signal: Array) -> float:
    known = signal[np.isfinite(signal)]
    return float(np.median(known)) if len(known) else 0.0


def _sign(table: Table, place: int, joint: str, config: AnalyseConfig) -> float:
    """Factor into our signs."""
    if config.signs is not None:
        return SIGN[config.signs]
    known = {name.lower(): signs for names in KNOWN_ANGLES[joint].values() for name, signs in names.items()}
    signs = known.get(known_name(table.names[place]))
    if signs is None:
        raise refuse(
            table.path,
            f"nothing says the sign of column {table.names[place]}, the {joint}; signs=opensim (hip flexion and dorsiflexion"
            " positive) or signs=posture (both negative) does",
        )
    return SIGN[signs]


def _time(table: Table, found: Mapping[int, Array], places: Sequence[int], config: AnalyseConfig) -> Array:
    """Times [s]. Raises ConfigError unless they increase."""
    if config.rate is not None and (places or table.rate):
        own = f"a column of times, {table.names[places[0]]}" if places else f"a sampling rate of {table.rate:g} Hz"
        raise refuse(table.path, f"has {own}, beside which rate= has no effect")
    if not places:
        rate = config.rate or table.rate
        assert rate is not None
        return np.arange(len(table.rows)) / rate
    (place,) = places if len(places) == 1 else (None,)
    if place is None:
        raise refuse(table.path, "columns.time: allowed is one column")
    name, unit = table.names[place], _typed_unit(table, place, "time", config) or table.units[place]
    if unit and unit not in _FACTOR["time"]:
        allowed = ", ".join(_FACTOR["time"])
        raise refuse(
            table.path,
            f"column {name}, the time, is in {unit}; allowed are {allowed}; \"columns.time='{name} [s]'\" sets the unit",
        )
    time = found[place] * _FACTOR["time"].get(unit, 1.0)
    missing, back = np.flatnonzero(np.isnan(time)), np.flatnonzero(~(np.diff(time) > 0))
    if len(missing):
        raise ConfigError(f"{table.place(int(missing[0]), place)}: has no time")
    if len(back):
        sample = int(back[0]) + 1
        before, now = found[place][sample - 1], found[place][sample]
        raise ConfigError(f"{table.place(sample, place)}: {now:.10g} does not come after {before:.10g}, the time before it")
    if not unit and len(time) > 1 and (apart := np.median(np.diff(time))) >= SLOW:
        raise refuse(
            table.path,
            f"nothing says the unit of column {name}, whose values are {apart:g} apart; \"columns.time='{name} [ms]'\", or "
            "[s], does; if these are numbers of frames, leave the column out and give rate=",
        )
    return time


def _simulated(table: Table, found: Mapping[int, Array], places: Sequence[int], config: AnalyseConfig) -> dict[str, Array]:
    """The signals of `SIMULATED`, the centre of pressure nan where no foot carries load."""
    signals = {
        name: _in_si(table, found[place], place, kind, name, config) if kind == "length" else found[place]
        for (name, kind), place in zip(SIMULATED.items(), places, strict=bool(places))
    }
    for (name, kind), place in zip(SIMULATED.items(), places, strict=bool(places)):
        if kind == "angle" and (table.units[place] or table.units_of.get("angle")) == "deg":
            signals[name] = np.radians(signals[name])
    if signals:
        signals["cop_x"] = np.where(signals.pop("foot_loaded") > 0, signals["cop_x"], np.nan)
    return signals


def _some(names: Sequence[str], most: int = 12) -> str:
    """The first names, for a message."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
