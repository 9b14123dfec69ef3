"""The claims of the paper, one declaration each, in the order of its figures; then its discrepancies.

Each says where it stands, which cases it is about, what the paper says and what is expected of it; then the
quantity of these cases, how it is written, and the band that it has to be in. Without a band it is reported.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from postproc.mokhtar2017.claims import cases
from postproc.mokhtar2017.claims import quantities as q
from postproc.mokhtar2017.claims.claim import Claim
from postproc.mokhtar2017.claims.loops import loops_of
from postproc.signals.contacts import contact_spans, free_decay, peak_after_contact
from postproc.store.rig_of_case import natural_frequencies, stator_frequencies
from rubhpc.errors import InputError

_OTHER_RIG = "reported: the rig of this figure is not in the paper"
_RESONANCE = "r {:.1f} ({:.1f} Hz), period {}, loops {}".format
_LINE = "{} ({:.2f} Hz)".format
_CRESTS = {Fraction(1): 1.7, Fraction(1, 2): 3.5, Fraction(1, 3): 5.3}  # of an order: the speed ratio

# fmt: off
CLAIMS: tuple[Claim, ...] = (
    # Table 1
    Claim(
        "C01", "Table 1", cases.LARGE_GAP,
        "Rotor at standstill: first lateral frequency",
        "31.56 Hz, 0.05 %",
        quantity=lambda case: float(natural_frequencies(case)["lateral"]),
        found="{:.2f} Hz".format,
        holds=lambda hertz: q.near(hertz, 31.56, 5e-4 * 31.56),
    ),
    Claim(
        "C02", "Table 1", cases.LARGE_GAP,
        "Rotor in torsion: first natural frequency",
        "128 Hz, 0.2 %",
        quantity=lambda case: float(natural_frequencies(case)["torsional"]),
        found="{:.2f} Hz".format,
        holds=lambda hertz: q.near(hertz, 128, 2e-3 * 128),
    ),
    Claim(
        "C03", "Table 1", cases.LARGE_GAP,
        "Stator of 3 GPa: first lateral frequency",
        "803 Hz, 0.2 %",
        quantity=lambda case: float(stator_frequencies(case)["lateral"]),
        found="{:.2f} Hz".format,
        holds=lambda hertz: q.near(hertz, q.STATOR, 2e-3 * q.STATOR),
    ),
    # Figs 5 to 9: pseudo-critical speeds, and r = 0.75 with the larger gap
    Claim(
        "C04", "5a", cases.FIRST,
        "30 GPa, cg 0.70, r 1.2 to 2.4: the orbit is largest at r 1.7, in a single loop, once a revolution",
        "r 1.6 to 1.8, period 1, 1 loop",
        quantity=q.resonance,
        found=_RESONANCE,
        holds=lambda ratio, hertz, period, loops: 1.6 <= ratio <= 1.8 and period == loops == 1,
    ),
    Claim(
        "C05", "5b", cases.SECOND,
        "Same, r 2.8 to 4.0: resonance of the half order at r 3.5, in two revolutions",
        "r 3.2 to 3.7, period 2, 2 loops",
        quantity=q.resonance,
        found=_RESONANCE,
        holds=lambda ratio, hertz, period, loops: 3.2 <= ratio <= 3.7 and period == loops == 2,
    ),
    Claim(
        "C06", "5c", cases.THIRD,
        "Same, r 4.6 to 6.0: resonance of the third order at r 5.3, in three revolutions",
        "r 4.8 to 5.5, period 3, 3 loops",
        quantity=q.resonance,
        found=_RESONANCE,
        holds=lambda ratio, hertz, period, loops: 4.8 <= ratio <= 5.5 and period == loops == 3,
    ),
    Claim(
        "C10", "6", cases.LARGE_GAP,
        "r 0.75, 3 GPa, g 100 µm: period of two revolutions",
        "period 2",
        quantity=q.period,
        found="period {}".format,
        holds=lambda period: period == 2,
    ),
    Claim(
        "C11", "6b", cases.LARGE_GAP,
        "Same: vertical motion has 1/2X, 1X, 3/2X, 2X",
        "each over 2 % of 1X",
        quantity=lambda case: q.heights(q.spectrum(case, "vertical"), 1, 0.5, 1.5, 2),
        found=lambda first, *others: f"1X {1e6 * first:.1f} µm; " + ", ".join(
            f"{name} {q.percent(h, first)}" for name, h in zip(("1/2X", "3/2X", "2X"), others, strict=True)
        ),
        holds=lambda first, *others: min(others) > 0.02 * first,
    ),
    Claim(
        "C12", "6d", cases.LARGE_GAP,
        "Same: horizontal motion has 1X and 3/2X, and more 3/2X than 1/2X",
        "3/2X over twice 1/2X, 1X the highest",
        quantity=lambda case: (
            *q.heights(lines := q.spectrum(case, "horizontal"), 0.5, 1, 1.5), q.strongest(lines)
        ),
        found=lambda *h: f"1/2X, 1X, 3/2X: {q.micrometres(h[:3])}",
        holds=lambda half, first, three, lines: three > 2 * half and lines[0].name == "1X",
    ),
    Claim(
        "C13", "6h", cases.LARGE_GAP,
        "Same: orbit of two lobes",
        "2 loops",
        quantity=loops_of,
        found="loops {}".format,
        holds=lambda loops: loops == 2,
    ),
    Claim(
        "C14", "6f", cases.LARGE_GAP,
        "Same: strongest torsion line 130.2 Hz, which is 11/2 X",
        "130.2 Hz within 0.3 Hz",
        quantity=lambda case: q.strongest(q.spectrum(case, "torsion"))[0],
        found=_LINE,
        holds=lambda name, hertz, *_: name == "11/2X" and q.near(hertz, 130.2, 0.3),
    ),
    Claim(
        "C16", "6e", cases.LARGE_GAP,
        "Same: torsion peaks after successive contacts differ (73.1 and 61.0 µrad)",
        "ratio 1.05 to 4; each within a factor 4",
        quantity=lambda case: q.alternating(peak_after_contact(case, "torsion").values),
        found=lambda high, low: f"{q.microradians([high, low])}; ratio {high / low:.2f}",
        holds=lambda high, low: (
            1.05 <= high / low <= 4 and 1 / 4 <= high / 73.1e-6 <= 4 and 1 / 4 <= low / 61.0e-6 <= 4
        ),
    ),
    Claim(
        "C17", "6e, 7a", cases.LARGE_GAP,
        "Same: contacts alternate in spacing (46 ms printed; a revolution takes 42.2 ms)",
        "long spacing 44 to 48 ms",
        quantity=lambda case: q.alternating(np.diff(contact_spans(case)["start"].values)),
        found=lambda *spacing: q.milliseconds(spacing),
        holds=lambda long, short: 44e-3 <= long <= 48e-3 and short < 0.99 * long,
    ),
    Claim(
        "C18", "7a", cases.LARGE_GAP,
        "Same: a contact lasts 3 ms",
        "2.5 to 4.2 ms",
        quantity=q.durations,
        found=lambda mean, *ends: f"{1e3 * mean:.2f} ms on average, {q.milliseconds(ends)} each",
        holds=lambda *times: min(times) >= 2.5e-3 and max(times) <= 4.2e-3,
    ),
    Claim(
        "C19", "7a", cases.LARGE_GAP,
        "Same: one contact a revolution and no force otherwise",
        "exact",
        quantity=q.contact_rate,
        found=lambda rate, share, sampled, *_: (
            f"{rate:g} a revolution, in {100 * share:.2f} % of the time "
            f"({100 * sampled:.2f} % of the samples)"
        ),
        holds=lambda rate, share, sampled, n_lacking, n_sample: (
            rate == 1 and n_lacking in (0, 1) and q.near(sampled, share, 2 / n_sample)
        ),
    ),
    Claim(
        "C20", "6g", cases.LARGE_GAP,
        "Same: torsional acceleration jumps at touch and at release",
        "jump over 5 times the local rms",
        quantity=q.least_jumps,
        found="least at touch {:.3g}, release {:.3g} times the rms".format,
        holds=lambda touch, release: touch > 5 and release > 5,
    ),
    Claim(
        "C21", "7b,c", cases.LARGE_GAP,
        "Same: the stator vibrates freely at 803 Hz between contacts",
        "within 1 % of 803 Hz",
        quantity=lambda case: (
            free_decay(case, "stator_lateral")["frequency"].values, float(stator_frequencies(case)["lateral"])
        ),
        found=lambda hertz, own: (
            f"{np.median(hertz):.1f} Hz, {hertz.min():.1f} to {hertz.max():.1f} Hz; undamped {own:.1f} Hz"
        ),
        holds=lambda hertz, own: (
            hertz.size > 0 and all(q.near(f, q.STATOR, 0.01 * q.STATOR) for f in hertz)
        ),
    ),
    Claim(
        "C22", "8b", cases.LARGE_GAP,
        "r 0.75, g 100 µm: Hilbert-Huang spectrum of torsion, contact masked, shows 128 Hz",
        "first mode, amplitude-weighted median 125 to 131 Hz",
        quantity=q.torsion_median,
        found="{:.1f} Hz".format,
        holds=lambda hertz: 125 <= hertz <= 131,
    ),
    Claim(
        "C23", "8c", cases.LARGE_GAP,
        "Same: that of the stator's lateral motion shows 803 Hz after release, and is broad in contact",
        "2 % over the first five cycles; spread over 40 Hz in contact, and over twice that out of it",
        quantity=q.stator_ringing,
        found="farthest {:.1f} Hz; spread {:.0f} Hz in contact, {:.0f} Hz out of it".format,
        holds=q.rings,
    ),
    Claim(
        "C24", "9", cases.SIXTH_HARMONIC,
        "20, 21.34, 22 Hz, g 56 µm: strongest torsion line 120, 128, 132 Hz, which is 6X",
        "within 0.3 Hz",
        quantity=lambda every: q.strongest_along(every, "torsion", "speed"),
        found=lambda *lines: ", ".join(_LINE(*line) for line in lines),
        holds=lambda *lines: all(
            line.name == "6X" and q.near(line.hertz, hertz, 0.3)
            for line, hertz in zip(lines, (120, 128, 132), strict=True)
        ),
    ),
    Claim(
        "C25", "9", cases.SIXTH_HARMONIC,
        "Same: torsion peak to peak 181.7, 513.7, 423.9 µrad",
        "second over third over first; first and third within 30 %",
        quantity=lambda every: q.sizes(every, "torsion")[0],
        found=q.microradians,
        holds=lambda size: (
            size[1] > size[2] > size[0]
            and 0.7 <= size[0] / 181.7e-6 <= 1.3 and 0.7 <= size[2] / 423.9e-6 <= 1.3
        ),
    ),
    # Figs 10 to 12: friction
    Claim(
        "C30", "10", cases.FRICTIONS,
        "r 0.75, g 100 µm, friction 0.1, 0.3, 0.5: torsion and stator lateral grow, their lines stay",
        "as 1 : 3 : 5 within 2 %, since the normal is fixed; same five strongest lines",
        quantity=lambda every: (*(
            size / size[0] for size in q.sizes(every, "torsion", "stator_lateral")
        ), {
            tuple(line.name for line in q.strongest(q.spectrum(every.sel(friction=mu), "torsion"), 5))
            for mu in every["friction"].values
        }),
        found=lambda torsion, lateral, names: "; ".join((
            *(f"{name} 1 : {ratio[1]:.3f} : {ratio[2]:.3f}"
              for name, ratio in (("torsion", torsion), ("lateral", lateral))),
            f"torsion lines {', '.join(*names)}" if len(names) == 1 else "lines differ",
        )),
        holds=lambda torsion, lateral, names: len(names) == 1 and all(
            np.allclose(ratio / (1, 3, 5), 1, rtol=0, atol=0.02) for ratio in (torsion, lateral)
        ),
    ),
    Claim(
        "C31", "11", cases.THREE,
        "r 3, g 76 µm, same frictions: torsion and horizontal motion grow, vertical does not",
        "monotone; vertical within 5 %",
        quantity=lambda every: q.sizes(every, "torsion", "horizontal", "vertical"),
        found=lambda torsion, horizontal, vertical: (
            f"torsion {q.milliradians(torsion)}; horizontal {q.micrometres(horizontal)}; "
            f"vertical {q.micrometres(vertical)}"
        ),
        holds=lambda torsion, horizontal, vertical: (
            q.rises(torsion) and q.rises(horizontal) and q.steady(vertical, 0.05)
        ),
    ),
    Claim(
        "C32", "12a", cases.THREE.but(friction=0.3),
        "Same, friction 0.3: horizontal motion has 1/2X (47.3 Hz) above 1X (94.7 Hz), and a small 3/2X",
        "frequencies within 0.4 Hz; 1/2X over 1X over 3/2X over 1 % of 1/2X",
        quantity=lambda case: (
            *q.heights(lines := q.spectrum(case, "horizontal"), 0.5, 1, 1.5), q.strongest(lines, 2)
        ),
        found=lambda *h: f"{_LINE(*h[3][0])} first; 1/2X, 1X, 3/2X: {q.micrometres(h[:3])}",
        holds=lambda half, first, three, lines: (
            q.near(lines[0].hertz, 47.3, 0.4) and q.near(lines[1].hertz, 94.7, 0.4)
            and half > first > three > 0.01 * half
        ),
    ),
    Claim(
        "C33", "12b", cases.THREE.but(friction=0.3),
        "Same: Hilbert-Huang spectrum of torsion shows 128 Hz out of contact",
        "amplitude-weighted median 122 to 134 Hz",
        quantity=lambda case: q.torsion_median(case, revolutions=None),
        found="{:.1f} Hz".format,
        holds=lambda hertz: 122 <= hertz <= 134,
    ),
    Claim(
        "C34", "11b", cases.THREE.but(friction=0.3),
        "Same: orbit of two loops",
        "period 2, 2 loops",
        quantity=q.repetition,
        found="period {}, loops {}".format,
        holds=lambda period, loops: period == loops == 2,
    ),
    # Figs 13 to 16: clearance
    Claim(
        "C40", "13", cases.SMALL_GAP,
        "r 0.75, g 84 µm: each revolution repeats, in a single loop",
        "period 1, 1 loop",
        quantity=q.repetition,
        found="period {}, loops {}".format,
        holds=lambda period, loops: period == loops == 1,
    ),
    Claim(
        "C41", "13c,d", (cases.LARGE_GAP, cases.SMALL_GAP),
        "Against g 100 µm: reaction and stator compression are 35 % higher (means of successive peaks)",
        "10 % to 80 % higher",
        quantity=lambda *gaps: (
            [float(contact_spans(case)["peak_force"].mean()) for case in gaps],
            [float(peak_after_contact(case, "stator_axial").mean()) for case in gaps],
        ),
        found=lambda force, pressed: (
            f"reaction {q.newtons(force)} {q.change(force)}, "
            f"compression {q.micrometres(pressed)} {q.change(pressed)}"
        ),
        holds=lambda *peaks: all(1.1 <= small / large <= 1.8 for large, small in peaks),
    ),
    Claim(
        "C44", "14a", cases.SMALL_GAP,
        "g 84 µm: vertical motion has 1X, 2X, 3X, and no half orders",
        "2X, 3X over 1 % of 1X, half orders under 0.5 %",
        quantity=lambda case: (*q.heights(q.spectrum(case, "vertical"), 1, 2, 3), q.half_orders(case)),
        found=lambda first, second, third, half: (
            f"1X {1e6 * first:.1f} µm; 2X {q.percent(second, first)}, 3X {q.percent(third, first)}, "
            f"half orders {q.percent(half)}"
        ),
        holds=lambda first, second, third, half: min(second, third) > 0.01 * first and half < 0.005,
    ),
    Claim(
        "C45", "14b", cases.SMALL_GAP,
        "Same: torsion has 118.3 Hz (5X) first, 142 Hz (6X) second",
        "within 0.3 Hz",
        quantity=lambda case: q.strongest(q.spectrum(case, "torsion"), 2),
        found=lambda *lines: ", ".join(
            f"{name} ({hertz:.2f} Hz, {1e6 * a:.1f} µrad)" for name, hertz, a, _ in lines
        ),
        holds=lambda first, second: (
            first.name == "5X" and q.near(first.hertz, 118.3, 0.3)
            and second.name == "6X" and q.near(second.hertz, 142.0, 0.3)
        ),
    ),
    Claim(
        "C46", "14c,d", cases.SMALL_GAP,
        "g 84 µm: torsion at 128 Hz, stator at 803 Hz; over 80 % of its amplitude gone in the free span",
        "as C22 and C23; under 20 % left",
        quantity=lambda case: (
            q.torsion_median(case), *q.stator_ringing(case), float(free_decay(case)["remaining"].max())
        ),
        found=lambda torsion, stator, contact, free, left: (
            f"torsion {torsion:.1f} Hz; stator {stator:.1f} Hz, spread {contact:.0f} Hz in contact, "
            f"{free:.0f} Hz out of it; {100 * left:.2g} % left"
        ),
        holds=lambda torsion, stator, contact, free, left: (
            125 <= torsion <= 131 and q.rings(stator, contact, free) and left < 0.2
        ),
    ),
    Claim(
        "C50", "15", cases.GAPS,
        "r 2, 30 GPa, g 70, 90, 110 µm: "
        "vertical, torsion, reaction and both stator amplitudes fall with the gap",
        "monotone",
        quantity=lambda every: (
            every["peak_contact_force"].values,
            *q.sizes(every, "vertical", "torsion", "stator_axial", "stator_lateral"),
        ),
        found=lambda force, vertical, torsion, axial, lateral: (
            f"vertical {q.micrometres(vertical)}; torsion {q.milliradians(torsion)}; "
            f"reaction {q.newtons(force)}; axial {q.micrometres(axial)}; lateral {q.millimetres(lateral)}"
        ),
        holds=lambda *every: all(map(q.falls, every)),
    ),
    Claim(
        # the rim passes the stator to +z, friction pushes it to -z
        "C51", "15b", cases.GAPS,
        "Same: horizontal motion hardly changes; its mean shifts with the friction force, more for less gap",
        "peak to peak within 10 %; mean negative, falling in size",
        quantity=lambda every: (
            *q.sizes(every, "horizontal"), every["horizontal"].mean("sample", dtype=float).values
        ),
        found=lambda size, mean: f"{q.micrometres(size)}; means {q.micrometres(mean)}",
        holds=lambda size, mean: q.steady(size, 0.1) and q.rises(mean) and mean.max() < 0,
    ),
    Claim(
        "C52", "16a,b", cases.GAPS.but(clearance=[70e-6, 110e-6]),
        "g 70 and 110 µm: strongest torsion line 126.3 Hz (2X)",
        "within 0.3 Hz",
        quantity=lambda both: q.strongest_along(both, "torsion", "clearance"),
        found=lambda *lines: ", ".join(
            f"{name} ({hertz:.2f} Hz, {1e3 * a:.2f} mrad)" for name, hertz, a, _ in lines
        ),
        holds=lambda *lines: all(line.name == "2X" and q.near(line.hertz, 126.3, 0.3) for line in lines),
    ),
    Claim(
        "C53", "16c", cases.GAPS.but(clearance=70e-6),
        "r 2, 30 GPa, g 70 µm: Hilbert-Huang spectrum of torsion shows 128 Hz between contacts",
        "124 to 132 Hz",
        quantity=q.torsion_median,
        found="{:.1f} Hz".format,
        holds=lambda hertz: 124 <= hertz <= 132,
    ),
    # Figs 17 to 19: stiffness of the stator
    Claim(
        "C60", "17d", cases.MODULI,
        "r 0.75, g 84 µm: contact time falls from 3 ms at 3 GPa to 1.2 ms at 30 GPa",
        "by a factor 2 to 3.3",
        quantity=lambda every: every["contact_duration"].values,
        found=lambda times: f"{q.milliseconds(times)}; factor {times[0] / times[-1]:.2f}",
        holds=lambda times: 2 <= times[0] / times[-1] <= 3.3 and q.falls(times),
    ),
    Claim(
        "C61", "17", cases.MODULI,
        "Same, 3, 15, 30 GPa: reaction up, compression down, torsion up, orbit little changed",
        "monotone; orbit peak to peak within 15 %",
        quantity=lambda every: (
            every["peak_contact_force"].values, q.compression(every),
            *q.sizes(every, "torsion", "vertical", "horizontal"),
        ),
        found=lambda force, pressed, torsion, vertical, horizontal: (
            f"reaction {q.newtons(force)}; compression {q.micrometres(pressed)}; "
            f"torsion {q.microradians(torsion)}; vertical {q.micrometres(vertical)}; "
            f"horizontal {q.micrometres(horizontal)}"
        ),
        holds=lambda force, pressed, torsion, *orbit: (
            q.rises(force) and q.falls(pressed) and q.rises(torsion)
            and all(q.steady(size, 0.15) for size in orbit)
        ),
    ),
    Claim(
        "C62", "18", (cases.NEAR_MODULI, cases.MODULI),
        "r 1.5, g 150 µm, same moduli: orbit and compression shrink, compression more than at r 0.75",
        "monotone",
        quantity=lambda near, below: (
            q.orbit_size(near).values, *(q.compression(every) for every in (near, below))
        ),
        found=lambda orbit, pressed, below: (
            f"orbit {q.micrometres(orbit)} from its centre; compression {q.micrometres(pressed)}; "
            f"down by {pressed[0] / pressed[-1]:.2f} times here, {below[0] / below[-1]:.2f} times at r 0.75"
        ),
        holds=lambda orbit, pressed, below: (
            q.falls(orbit) and q.falls(pressed) and pressed[0] / pressed[-1] > below[0] / below[-1]
        ),
    ),
    Claim(
        "C63", "19", (cases.MODULI, cases.NEAR_MODULI),
        "r 0.75 and 1.5: stator lateral motion is smaller, and decays faster, for a larger modulus",
        "monotone",
        quantity=lambda *speeds: tuple(
            (*q.sizes(every, "stator_lateral"), q.decay_rates(every, "stator_youngs_modulus"))
            for every in speeds
        ),
        found=lambda *speeds: "; ".join(
            f"r {ratio}: {q.millimetres(size)}, decay {q.written(rate, '1/s')}"
            for ratio, (size, rate) in zip((0.75, 1.5), speeds, strict=True)
        ),
        holds=lambda *speeds: all(q.falls(size) and q.rises(rate) for size, rate in speeds),
    ),
    # Fig. 20: the cascade
    Claim(
        "C70", "20", cases.STIFF_SPEEDS,
        "30 GPa, cg 0.70, r 0.9 to 6.1: torsion is dominated by 3X at r 1.3, 2X at r 1.9, 1X at r 4.1",
        "strongest line within one bin of each",
        quantity=lambda every: q.dominating(every, 1.3, 1.9, 4.1),
        found=lambda _, *lines: "; ".join(
            f"r {ratio}: {line.name} ({line.hertz:.1f} Hz)"
            for ratio, line in zip((1.3, 1.9, 4.1), lines, strict=True)
        ),
        holds=lambda resolution, *lines: all(
            q.near(line.order, order, resolution) for line, order in zip(lines, (3, 2, 1), strict=True)
        ),
    ),
    Claim(
        "C71", "20", (cases.STIFF_SPEEDS, cases.FIRST),
        "Same: lines that pass the pseudo-critical frequency crest at r 1.7 (1X), 3.5 (1/2X), 5.3 (1/3X)",
        "within 0.2 in r",
        quantity=lambda every, first: q.crests(every, first, _CRESTS),
        found=lambda crests, hertz: (
            ", ".join(f"{order}X at r {ratio:.1f}" for order, ratio in crests.items())
            + f"; frequency {hertz:.1f} Hz"
        ),
        holds=lambda crests, _: all(q.near(r, _CRESTS[order], 0.2 + 1e-9) for order, r in crests.items()),
    ),
    Claim(
        "C72", "20", cases.STIFF_SPEEDS,
        "Same: strong multiples of 1/3X at r 5.3 and of 1/2X at r 3.5",
        "the first four over 5 % of the strongest line",
        quantity=lambda every: q.multiples(every, {5.3: Fraction(1, 3), 3.5: Fraction(1, 2)}),
        found=lambda shares: "; ".join(
            f"r {ratio}: {', '.join(map(q.percent, share))}" for ratio, share in shares.items()
        ),
        holds=lambda shares: all(min(share) > 0.05 for share in shares.values()),
    ),
    # Conclusions, and the models of Figs 3 and 4
    Claim(
        "C73", "6, 14", (cases.LARGE_GAP, cases.SMALL_GAP),
        "r 0.75: subharmonics below the critical speed with the larger gap only",
        "period 2 at 100 µm, 1 at 84 µm; half orders over 2 %, under 0.5 % of 1X",
        quantity=lambda *gaps: ([q.period(case) for case in gaps], [q.half_orders(case) for case in gaps]),
        found=lambda periods, shares: (
            f"period {' and '.join(map(str, periods))}; half orders {' and '.join(map(q.percent, shares))}"
        ),
        holds=lambda periods, shares: periods == [2, 1] and shares[0] > 0.02 and shares[1] < 0.005,
    ),
    Claim(
        "C80", "3", cases.FREEDOM,
        "Stator free to bend or not, updated normal, r 0.75, 1.5, 3: the orbit tilts with it, most at r 1.5",
        _OTHER_RIG,
        quantity=lambda every: {
            ratio: [
                (math.degrees(q.tilt(case)), 1e6 * float(case["peak_to_peak_vertical"]))
                for case in (every.sel(speed_ratio=ratio, stator_1_lateral=on) for on in (1, 0))
            ]
            for ratio in every["speed_ratio"].values
        },
        found=lambda leaning: "; ".join(
            f"r {ratio:g}: {free[0]:.0f}° against {held[0]:.0f}°, "
            f"vertical {free[1]:.0f} against {held[1]:.0f} µm"
            for ratio, (free, held) in leaning.items()
        ),
    ),
    Claim(
        "C81", "4", (cases.WALL, cases.SMALL_GAP),
        "Conventional law (fixed wall, contact stiffness, Coulomb friction) against the multiplier: "
        "vertical motion close, torsion larger and less regular",
        f"{_OTHER_RIG}, nor is its contact stiffness",
        quantity=lambda *laws: tuple(
            (q.period(case), q.sizes(case, "vertical", "torsion"),
             [100 * q.unevenness(case[name]) for name in ("vertical", "torsion")])
            for case in laws
        ),
        found=lambda *laws: "; ".join(
            f"{name}: period {period}, vertical {q.micrometres(size[0])} (uneven by {uneven[0]:.2g} %), "
            f"torsion {q.microradians(size[1])} (uneven by {uneven[1]:.2g} %)"
            for name, (period, size, uneven) in zip(("wall", "multiplier"), laws, strict=True)
        ),
    ),
    # Where the paper disagrees with itself, or leaves the range of its model
    Claim(
        "D1", "5", (cases.STIFF_SPEEDS.but(stator_youngs_modulus=cases.SOFT), cases.STIFF_SPEEDS),
        "Pseudo-critical speeds r 1.7, 3.5, 5.3; the caption names no modulus",
        "reported: they belong to 30 GPa",
        quantity=lambda *moduli: tuple(q.largest_by_period(every) for every in moduli),
        found=lambda *moduli: "; ".join(
            f"{modulus} GPa: r {', '.join(f'{ratio:.1f}' for ratio in ratios)}"
            for modulus, ratios in zip((3, 30), moduli, strict=True)
        ),
    ),
    Claim(
        "D2", "3, 5, 17, 18", (cases.SMALL_GAP, cases.FREEDOM.but(speed_ratio=0.75, stator_1_lateral=1)),
        "One normal for all figures",
        "reported: Fig. 3 needs the updated one, the others the fixed one",
        quantity=lambda *normals: tuple(float(case["peak_contact_force"]) for case in normals),
        found="peak reaction at r 0.75, cg 0.70: {:.1f} N fixed, {:.1f} N updated".format,
    ),
    Claim(
        "D3", "16, 18", (cases.NEAR_MODULI, cases.GAPS),
        "cg of 150 µm at r 1.5 is 0.70, of 70 µm at r 2 is 0.55 (0.54 in Fig. 15)",
        "reported: the paper's values disagree",
        quantity=lambda near, above: tuple(
            gap / float(every["contact_free_amplitude"]) for gap, every in ((150e-6, near), (70e-6, above))
        ),
        found="{:.2f} and {:.2f}".format,
    ),
    Claim(
        "D4", "6, 7, 13", (cases.LARGE_GAP, cases.SMALL_GAP),
        "r 0.75: reaction up to 10 N, torsion within 75 µrad",
        "reported: Table 1 gives twice that at these gaps; the levels of Fig. 9 agree with it",
        quantity=lambda *gaps: tuple(
            (sorted(set(contact_spans(case)["peak_force"].values.round(1))), float(case["peak_torsion"]))
            for case in gaps
        ),
        found=lambda *gaps: "; ".join(
            f"{gap} µm: {q.newtons(peaks)}, {1e6 * torsion:.0f} µrad"
            for gap, (peaks, torsion) in zip((100, 84), gaps, strict=True)
        ),
    ),
    Claim(
        "D5", "13b", (cases.LARGE_GAP, cases.SMALL_GAP),
        "Torsion is 10 % lower at 84 µm than at 100 µm",
        "reported: the size of the drop depends on the damping, which is not stated; its sign holds",
        quantity=lambda *gaps: [float(q.sizes(case, "torsion")[0]) for case in gaps],
        found=lambda size: f"peak to peak {q.microradians(size)} {q.change(size)}",
    ),
    Claim(
        "D6", "20", (cases.STIFF_SPEEDS, cases.STIFF_SPEEDS.but(speed_ratio=5.7)),
        "Same: at r 5.7 the strongest torsion line is named 14/20 X (126 Hz)",
        "reported: it takes a period of 20 revolutions",
        quantity=lambda every, case: (q.dominating(every, 5.7)[1], q.period(case)),
        found=lambda line, period: f"{line.name} ({line.hertz:.1f} Hz), period {period}",
    ),
    Claim(
        "D7", "5, 11, 18",
        (cases.NEAR_MODULI.but(stator_youngs_modulus=cases.SOFT), cases.THREE.but(friction=0.5),
         *(cases.STIFF_SPEEDS.but(speed_ratio=ratio) for ratio in _CRESTS.values())),
        "The model holds at r 1.5 and 3 (3 GPa) and at the resonances of 30 GPa",
        "reported: force over the Euler load, a tip that moves far, slip that changes sign",
        quantity=lambda *shown: tuple(
            [float(case[n]) for n in ("force_over_euler_load", "tip_deflection_ratio", "minimum_slip_speed")]
            for case in shown
        ),
        found=lambda *shown: "; ".join(
            f"r {name}: {force:.2g} of the Euler load, tip {100 * tip:.0f} % of its length, "
            f"slip down to {slip:.0f} m/s"
            for name, (force, tip, slip) in zip(
                ("1.5", "3", "1.7, 30 GPa", "3.5, 30 GPa", "5.3, 30 GPa"), shown, strict=True
            )
        ),
    ),
    Claim(
        "D9", "18a", cases.NEAR_MODULI,
        "r 1.5: vertical and horizontal motion both shrink for a larger modulus",
        "reported: horizontal motion depends on the damping, which is not stated",
        quantity=lambda every: q.sizes(every, "vertical", "horizontal"),
        found=lambda *sizes: "vertical {}; horizontal {}".format(*map(q.micrometres, sizes)),
    ),
)
# fmt: on


def on_figure(number: int) -> list[Claim]:
    """Return the claims on one figure of the paper.

    Raises
    ------
    InputError
        None is.
    """
    found = [claim for claim in CLAIMS if number in claim.figures]
    if not found:
        known = sorted({n for claim in CLAIMS for n in claim.figures})
        raise InputError(f"--figure {number}: no claim on it; there are {', '.join(map(str, known))}")
    return found
