"""The page of an analysis: one file of HTML that loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from somersault import viewer
from somersault._analysis import joint_angles, rms_of
from somersault._somersault.motion import WhatIf

if TYPE_CHECKING:
    from somersault._analysis import FlightAnalysis

__all__ = ["page"]

Array = NDArray[np.float64]

#: Characters of a cell that is a number with its unit.
_SHORT = 24
_WIDE, _HIGH, _LEFT, _RIGHT, _TOP, _FOOT = 640, 240, 56, 14, 12, 44
_COLOURS = ("#3949ab", "#c2410c", "#15803d", "#6b7280", "#9333ea")
_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 62rem; padding: 1rem; }
h1 { font-size: 1.6rem; margin: .5rem 0; } h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
p, h1 { overflow-wrap: anywhere; }
.scroll { overflow-x: auto; } table { border-collapse: collapse; width: 100%; }
td, th { border-bottom: 1px solid #8884; padding: .3rem .6rem .3rem 0; }
td, th { text-align: left; vertical-align: top; }
td.n { font-variant-numeric: tabular-nums; white-space: nowrap; }
.state { border-left: .3rem solid; padding: .5rem .8rem; background: #8881; }
.good { border-color: #15803d; } .bad { border-color: #b91c1c; }
li { margin: .4rem 0; } svg { display: block; width: 100%; height: auto; }
svg text { fill: currentColor; font-size: 15px; }
iframe { border: 1px solid #d9dde5; height: 460px; width: 100%; }
.charts { display: grid; gap: 1rem; }
.charts { grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); }
figure { margin: 0; } figcaption, small { opacity: .8; font-size: .85rem; } .key { white-space: nowrap; }
@media (max-width: 32rem) {
  td, th { font-size: .8rem; padding-right: .35rem; } td.n { white-space: normal; }
}
@media (prefers-color-scheme: dark) { body { background: #111; color: #ddd; } }
"""
#: Where a recording may depart from the laws of flight, and from the body.
_DEPARTURES = {
    "whole": "from the laws of flight over the whole flight",
    "start": "from the laws of flight at the start",
    "end": "from the laws of flight at the end",
    "size": "from the size",
    "air": "by a drag",
    "push": "by a push",
    "places": "from the places of the markers",
    "plane": "from the plane of the body",
}
#: Rows of the report: title, attribute, factor, unit and digits.
_VALUES = (
    ("Somersaults", "somersaults", 1.0, "", 2),
    ("Twists", "twists", 1.0, "", 2),
    ("Flight time", "duration", 1.0, " s", 2),
    ("Height above take-off", "height", 1.0, " m", 2),
    ("Take-off speed", "speed", 1.0, " m/s", 2),
    ("Take-off angle above the horizontal", "take_off_angle", 180 / np.pi, "°", 0),
    ("Angular momentum", "angular_momentum", 1.0, " kg m²/s", 1),
    ("Least moment of inertia", "least_inertia", 1.0, " kg m²", 2),
    ("Greatest moment of inertia", "greatest_inertia", 1.0, " kg m²", 2),
    ("Hip where it is closed most", "hip", 180 / np.pi, "°", 0),
    ("Knee there", "knee", 180 / np.pi, "°", 0),
    ("Entry beyond the vertical", "entry_angle", 180 / np.pi, "°", 0),
)


def page(analysis: FlightAnalysis) -> str:
    """The page of an analysis."""
    found = analysis
    state = "good" if found.success else "bad"
    number = found.report.number if found.success else None
    title = found.name if number is None else f"{found.name}: {number}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="state {state}">{escape(found.message)}</p>',
        _advice(found),
        f"<h2>The recording and the reconstruction</h2>{_scene(found)}",
    ]
    if found.success:
        parts += [_values(found), _checks(found), _curves(found), _changes(found), _optimum(found)]
    else:
        parts.append(_checks(found))
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(found.name)}</title><style>{_STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )


def _advice(found: FlightAnalysis) -> str:
    if found.advice is None:
        return "<h2>Advice</h2><p>There is no advice, since there is no analysis.</p>"
    message = found.advice.message
    entry = f"<p>{escape(message[:1].upper() + message[1:])}.</p>"
    rows = "".join(f"<li>{escape(advice.words)}</li>" for advice in found.advice.advice)
    note = ""
    if rows:
        rows = f"<ol>{rows}</ol>"
        note = (
            "<p><small>Amounts are for a vertical entry, each change alone, ± half of its 95 %"
            " interval: the angle at the entry and"
            " its effect as the reconstruction knows them, the effect from flights flown again. What"
            " is named first covers most"
            " of the error within reach.</small></p>"
        )
    withheld = ", ".join(name.replace("_", " ") for name in found.advice.withheld)
    if withheld:
        reason = "the interval spans zero, the effect is not sure, or too little is within reach"
        note += f"<p><small>Withheld, since {reason}: {withheld}.</small></p>"
    return f"<h2>Advice</h2>{entry}{rows}{note}"


def _scene(found: FlightAnalysis) -> str:
    scene = viewer.Scene(found.name)
    scene.add(found.flight, label="reconstruction", color=_COLOURS[0])
    # a recording may be longer than its flight
    scene.add(found.recording, label="recorded markers", color=_COLOURS[1])
    if found.optimum is not None:
        best, start = found.optimum, float(found.flight.times[0])
        model = best.dive.diver.model
        q = np.array(best.q)
        # where the reconstruction begins
        moved = np.asarray(found.flight.center_of_mass)[0] - np.asarray(model.center_of_mass(q[0]))
        along = [0, 1, 2] if model.links[0].joint == "free" else [0, 2]
        q[:, : len(along)] += moved[along]
        scene.add(model, np.asarray(best.t) + start, q, label="optimum", color=_COLOURS[2], panel=1)
    return str(scene.camera("side").play(0.25)._repr_html_())


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(title)}</th>" for title in head)
    top = f"<tr>{top}</tr>" if head else ""
    lines = "".join(
        "<tr>" + "".join(f"<td{_kind(cell)}>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="scroll"><table>{top}{lines}</table></div>'


def _kind(cell: str) -> str:
    """Numbers with their units stay in one line, texts do not."""
    return ' class="n"' if len(cell) < _SHORT and any(letter.isdigit() for letter in cell) else ""


def _value(value: float, interval: tuple[float, float], factor: float, unit: str, digits: int) -> str:
    half = 0.5 * (interval[1] - interval[0]) * factor
    if not np.isfinite(half):
        return f"{value * factor:.{digits}f}{unit} at least"
    # digits that the interval has
    digits = max(digits, int(half < 1.0))
    return f"{value * factor:.{digits}f} ± {half:.{digits}f}{unit}"


def _values(found: FlightAnalysis) -> str:
    report = found.report
    rows = [
        (title, _value(getattr(report, name), getattr(report, f"{name}_interval"), factor, unit, digits))
        for title, name, factor, unit, digits in _VALUES
    ]
    note = (
        "<p><small>± half of the 95 % intervals, for the given masses and places of the markers.</small></p>"
    )
    return f"<h2>Values</h2>{_table((), rows)}{note}"


def _checks(found: FlightAnalysis) -> str:
    flight, report = found.flight, found.report
    chi = "–" if flight.chi_squared is None else f"{flight.chi_squared:.2f}"
    lower, upper = flight.chi_squared_range
    gravity = _value(report.gravity, report.gravity_interval, 1.0, " m/s²", 2)
    rows = [
        ("Gravity in the recording", gravity, "that of the model, or the rate or the unit is wrong"),
        ("χ² per degree of freedom", chi, f"from {lower:.2f} to {upper:.2f}"),
        ("Distance of the markers, root mean square", f"{1e3 * rms_of(flight):.0f} mm", "at most 80 mm"),
        (
            "Angle to the full equations of motion",
            f"{flight.full_dynamics_defect:.1e} rad",
            "at most 1e-03 rad",
        ),
        ("Size over that of the model", f"{flight.scale:.3f} ± {1.96 * flight.scale_deviation:.3f}", ""),
        (
            "Noise of a coordinate",
            f"{1e3 * flight.noise[0]:.0f} mm",
            f"{100 * flight.noise[1]:.0f} % correlated",
        ),
    ]
    limits = flight.departure_limits
    for kind, departure in flight.departures.items():
        if not np.isnan(departure):
            rows.append((f"Departure {_DEPARTURES[kind]}", f"{departure:.1f}", f"at most {limits[kind]:.1f}"))
    if flight.unseen:
        rows.append(("Joints that no marker sees", ", ".join(flight.unseen), ""))
    return f"<h2>Checks</h2>{_table(('', 'found', 'must be'), rows)}"


def _curves(found: FlightAnalysis) -> str:
    flight = found.flight
    t = np.asarray(flight.times)
    degrees = 180.0 / np.pi
    turned = degrees * np.asarray(flight.inclination)
    band = 1.96 * degrees * np.asarray(flight.inclination_deviation)
    inertia, of_inertia = (
        np.asarray(flight.moment_of_inertia),
        1.96 * np.asarray(flight.moment_of_inertia_deviation),
    )
    phase = next((change.phase for change in found.what_ifs if change.phase), None)
    figures = [
        _chart("Angle of the long axis from the vertical, °", [("angle", t, turned, band)], phase),
        _chart(
            "Moment of inertia about the axis of the somersault, kg m²",
            [("inertia", t, inertia, of_inertia)],
            phase,
        ),
    ]
    recorded = joint_angles(flight.model, np.asarray(flight.q))
    optimal = {}
    if found.optimum is not None:
        optimal = joint_angles(found.optimum.dive.diver.model, np.asarray(found.optimum.q))
    for joint in ("hip", "knee"):
        if joint not in recorded:
            # balls of another model have no angles of these names
            continue
        lines: list[Any] = [("recorded", t, degrees * recorded[joint], None)]
        if joint in optimal and found.optimum is not None:
            lines.append(("optimum", np.asarray(found.optimum.t) + t[0], degrees * optimal[joint], None))
        figures.append(_chart(f"Flexion of the {joint}, °", lines, phase))
    note = (
        "<p><small>Bands are 95 % intervals; the posture is held in the grey part.</small></p>"
        if phase
        else ""
    )
    return f'<h2>Curves</h2><div class="charts">{"".join(figures)}</div>{note}'


def _amount(change: WhatIf) -> str:
    if change.opening:
        return f"open {1e3 * abs(change.opening):.0f} ms {'later' if change.opening > 0 else 'earlier'}"
    if change.posture:
        return f"fold {np.degrees(abs(change.posture)):.0f}° {'tighter' if change.posture > 0 else 'looser'}"
    if change.momentum:
        return (
            f"{100 * abs(change.momentum):.0f} % {'more' if change.momentum > 0 else 'less'} angular momentum"
        )
    return f"{100 * abs(change.height):.0f} cm {'higher' if change.height > 0 else 'less high'}"


def _changes(found: FlightAnalysis) -> str:
    if not found.what_ifs:
        return ""
    rows = [
        (
            _amount(change),
            f"{change.somersaults_change:+.3f}",
            f"{change.twists_change:+.3f}",
            f"{np.degrees(change.entry_angle_change):+.1f}°",
            f"{np.degrees(change.linear_entry_angle_change):+.1f}°"
            + ("" if change.agrees else " (not used)"),
        )
        for change in found.what_ifs
    ]
    head = ("change", "somersaults", "twists", "entry, flown", "entry, linear")
    return f"<h2>What would have been</h2>{_table(head, rows)}"


def _optimum(found: FlightAnalysis) -> str:
    text = f"<h2>Against the optimum</h2><p>{escape(found.optimum_message)}</p>"
    if not found.differences:
        return text
    t = np.asarray(found.flight.times)
    lines = [(joint, t, 180 / np.pi * curve, None) for joint, curve in found.differences.items()]
    return text + _chart("Recorded less optimal angles of the joints, °", lines, None)


def _ticks(low: float, high: float, n: int) -> list[float]:
    raw = (high - low) / n
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= raw)
    return [float(x) for x in np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step]


def _chart(
    title: str,
    lines: Sequence[tuple[str, Array, Array, Array | None]],
    phase: tuple[float, float, float, float] | None,
) -> str:
    """Curves over time as inline SVG, with bands where there are some."""
    ends = [(t[0], t[-1]) for _, t, _, _ in lines]
    start, end = min(a for a, _ in ends), max(b for _, b in ends)
    spread = [y if band is None else np.concatenate([y - band, y + band]) for _, _, y, band in lines]
    low, high = float(min(map(np.min, spread))), float(max(map(np.max, spread)))
    room = 0.05 * (high - low) or 1.0
    low, high = low - room, high + room

    def x(t: Any) -> Any:
        return _LEFT + (t - start) / (end - start) * (_WIDE - _LEFT - _RIGHT)

    def y(value: Any) -> Any:
        return _TOP + (high - value) / (high - low) * (_HIGH - _TOP - _FOOT)

    def points(t: Array, values: Array) -> str:
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x(t), y(values), strict=True))

    drawn = []
    if phase is not None:
        left, right = x(phase[1]), x(phase[2])
        place = f'x="{left:.1f}" y="{_TOP}" width="{right - left:.1f}" height="{_HIGH - _TOP - _FOOT}"'
        drawn.append(f'<rect {place} fill="#8883"/>')
    for value in _ticks(low, high, 4):
        drawn.append(
            f'<path d="M{_LEFT} {y(value):.1f}H{_WIDE - _RIGHT}" stroke="#8884"/>'
            f'<text x="{_LEFT - 6}" y="{y(value) + 5:.1f}" text-anchor="end">{value + 0.0:g}</text>'
        )
    for value in _ticks(start, end, 6):
        drawn.append(f'<text x="{x(value):.1f}" y="{_HIGH - 24}" text-anchor="middle">{value:g}</text>')
    drawn.append(f'<text x="{_WIDE - _RIGHT}" y="{_HIGH - 5}" text-anchor="end">time, s</text>')
    keys = []
    for k, (name, t, values, band) in enumerate(lines):
        colour = _COLOURS[k % len(_COLOURS)]
        if band is not None:
            edge = points(t, values + band) + " " + points(t[::-1], (values - band)[::-1])
            drawn.append(f'<polygon points="{edge}" fill="{colour}" opacity=".25"/>')
        drawn.append(
            f'<polyline points="{points(t, values)}" fill="none" stroke="{colour}" stroke-width="2"/>'
        )
        keys.append(f'<span class="key" style="color:{colour}">— {escape(name)}</span>')
    key = f" {' '.join(keys)}" if len(lines) > 1 else ""
    return (
        f"<figure><figcaption>{escape(title)}{key}</figcaption>"
        f'<svg role="img" aria-label="{escape(title)}" viewBox="0 0 {_WIDE} {_HIGH}">'
        f"{''.join(drawn)}</svg></figure>"
    )
