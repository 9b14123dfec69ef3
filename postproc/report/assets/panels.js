// Orbit, section, spectrum and waveform of one case.
const CURVES = ["curve", "mark", "ok", "accent", "soft", "ground", "bad"];
const ORBIT = ["vertical", "horizontal"];

// The simplest fraction within half a line's spacing, as in 1/2X.
function orderName(order, tolerance) {
  for (let below = 1; below <= 8; below++) {
    const above = Math.round(order * below);
    if (above && Math.abs(above / below - order) <= tolerance) return (below === 1 ? `${above}` : `${above}/${below}`) + "X";
  }
  return order.toFixed(2) + "X";
}

class Panel {
  constructor(id) {
    this.place = byId(id);
    this.plot = this.place.querySelector(".plot");
    this.words = this.place.querySelector(".message");
    this.heading = this.place.querySelector("h3");
  }

  async build(options, add) {
    this.figure = makeFigure({ x_range: new Bokeh.Range1d(), y_range: new Bokeh.Range1d(), ...options });
    const paint = add(this.figure);
    await show(this.figure, this.plot, paint);
  }

  say(text) {
    this.words.textContent = text;
    this.words.hidden = !text;
    this.place.classList.toggle("void", Boolean(text));
    if (text) this.describe(text);
  }

  describe(text) {
    this.plot.setAttribute("aria-label", `${this.heading.textContent}: ${text}`);
  }
}

// A plane in which lengths across and up are alike.
class Plane extends Panel {
  async start(add) {
    await this.build({}, add);
    for (const side of ["x", "y"]) setTicker(this.figure, side, new Bokeh.BasicTicker({ desired_num_ticks: 4 }));
    for (const side of ["inner_width", "inner_height"]) this.figure.properties[side].change.connect(() => this.fit());
  }

  // Show all points, with a margin, and no less than `least` to either side.
  frame(y, z, margin, least = 0) {
    const ends = (v) => [Math.min(...v), Math.max(...v)];
    const [[bottom, top], [left, right]] = [ends(y), ends(z)];
    const reach = Math.max((margin * Math.max(top - bottom, right - left)) / 2, least);
    this.window = { y: (bottom + top) / 2, z: (left + right) / 2, reach };
    this.fit();
  }

  fit() {
    const { inner_width: width, inner_height: height } = this.figure;
    if (!this.window || !width || !height) return;
    const { y, z, reach } = this.window, short = Math.min(width, height);
    setRange(this.figure.x_range, z - (reach * width) / short, z + (reach * width) / short);
    setRange(this.figure.y_range, y - (reach * height) / short, y + (reach * height) / short);
  }

  label() {
    const { unit } = facts.signals.vertical;
    this.figure.xaxis.axis_label = `Horizontal (${unit})`;
    this.figure.yaxis.axis_label = `Vertical (${unit})`;
  }
}

class Orbit extends Plane {
  async begin() {
    await this.start((figure) => {
      this.circle = source({ z: [], y: [] });
      this.faces = source({ zs: [], ys: [] });
      this.path = source({ z: [], y: [] });
      this.marks = source({ z: [], y: [] });
      this.first = source({ z: [], y: [] });
      const drawn = {
        circle: figure.line({ field: "z" }, { field: "y" }, { source: this.circle, line_dash: "dotted", line_width: 1.2 }),
        faces: figure.patches({ field: "zs" }, { field: "ys" }, { source: this.faces, line_color: null }),
        path: figure.line({ field: "z" }, { field: "y" }, { source: this.path, line_width: 1.3 }),
        marks: figure.scatter({ field: "z" }, { field: "y" }, { source: this.marks, size: 5, line_color: null }),
        first: figure.scatter({ field: "z" }, { field: "y" }, { source: this.first, size: 11, fill_color: null, line_width: 1.6 }),
      };
      return () => {
        drawn.circle.glyph.line_color = ink("ground");
        drawn.faces.glyph.fill_color = ink("ground");
        drawn.path.glyph.line_color = ink("curve");
        drawn.marks.glyph.fill_color = drawn.first.glyph.line_color = ink("mark");
      };
    });
  }

  draw(record, clearance) {
    const [vertical, horizontal] = ORBIT.map((name) => record.waves.find((w) => w.name === name));
    if (!vertical || !horizontal) return this.say(notKept("waveform"));
    this.say("");
    const y = vertical.values.slice(), z = horizontal.values.slice();
    const [low, high] = [Math.min, Math.max].map((f) => [f(...y), f(...z)]);
    const reach = 0.575 * Math.max(high[0] - low[0], high[1] - low[1], 1e-12);
    const away = Math.hypot(low[0] + high[0], low[1] + high[1]) / 2; // of the orbit from the shaft without loads
    const isWhole = record.period > 0 && (y.length / record.samples) % record.period === 0;
    this.path.data = isWhole ? { y: [...y, y[0]], z: [...z, z[0]] } : { y, z };
    const turns = y.map((_, i) => i).filter((i) => i % record.samples === 0);
    this.marks.data = { y: turns.map((i) => y[i]), z: turns.map((i) => z[i]) };
    this.first.data = { y: [y[0]], z: [z[0]] };
    const { unit, factor } = facts.signals.vertical;
    const gap = clearance * factor;
    const isNear = gap > 0 && gap < 3.5 * reach && Math.abs(gap - away) < 5 * reach;
    const faces = this.bench(isNear ? gap : 0, factor, record.places ?? facts.places, reach);
    this.label();
    const centre = isNear || away < 3.5 * reach ? [0] : []; // where it is near: a sag may be many orbits large
    this.frame([...centre, ...y, ...faces.map((p) => p[1])], [...centre, ...z, ...faces.map((p) => p[0])], 1.12);
    const n = y.length / record.samples, farthest = Math.max(...[...low, ...high].map(Math.abs));
    this.describe(`${n} revolutions, reaching ${withUnit(farthest, unit)}; clearance ${withUnit(clearance * factor, unit)}`);
  }

  // The circle of the clearance, and the face of each stator, none without a gap; returns their corners.
  bench(gap, factor, places, reach) {
    const turn = gap > 0 ? Array.from({ length: 121 }, (_, i) => (i * Math.PI) / 60) : [];
    const bore = places.find(([angle]) => angle === null); // it has no angle: its wall is the circle
    const [, offset0, z0 = 0, y0 = 0] = (bore ?? places[0] ?? []).map((value) => value * factor); // about which they are set
    if (bore && gap > 0) gap += offset0;
    this.circle.data = { z: turn.map((a) => z0 + gap * Math.sin(a)), y: turn.map((a) => y0 + gap * Math.cos(a)) };
    const halfAngle = Math.PI / Math.max(places.length, 3); // the stators of a ring do not overlap
    const stubs = gap > 0 ? places.filter(([angle]) => angle !== null) : [];
    const faces = stubs.map(([angle, offset]) => {
      const near = gap + offset * factor, far = near + 0.12 * reach, half = Math.min(0.22 * reach, 0.8 * near * Math.tan(halfAngle));
      const [s, c] = [Math.sin(angle), Math.cos(angle)];
      const corner = (along, across) => [z0 + along * s + across * c, y0 + along * c - across * s];
      return [corner(near, -half), corner(near, half), corner(far, half), corner(far, -half)];
    });
    this.faces.data = { zs: faces.map((f) => f.map((p) => p[0])), ys: faces.map((f) => f.map((p) => p[1])) };
    return faces.flat();
  }
}

class Section extends Plane {
  async begin() {
    await this.start((figure) => {
      this.points = source({ z: [], y: [] });
      const drawn = figure.scatter({ field: "z" }, { field: "y" }, { source: this.points, size: 6, fill_alpha: 0.75, line_color: null });
      return () => (drawn.glyph.fill_color = ink("mark"));
    });
  }

  draw(record) {
    const [vertical, horizontal] = ORBIT.map((name) => record.section.find((s) => s.name === name));
    if (!vertical || !horizontal) return this.say(notKept("section"));
    this.say("");
    const y = vertical.values, z = horizontal.values;
    this.points.data = { y, z };
    this.label();
    // Points of a periodic motion differ by rounding; they are not to fill the panel.
    this.frame(y, z, 1.25, 0.03 * Math.max(...y.map(Math.abs), ...z.map(Math.abs), 1e-12));
    this.describe(`${y.length} points, one a revolution`);
  }
}

class Spectrum extends Panel {
  async begin() {
    await this.build({}, (figure) => {
      this.lines = source({ x: [], low: [], high: [], color: [] });
      this.names = source({ x: [], y: [], text: [] });
      this.modes = source({ x: [], low: [], high: [] });
      this.modeNames = source({ x: [], y: [], text: [] });
      setTicker(figure, "x", new Bokeh.BasicTicker({ desired_num_ticks: 5 }));
      const upright = { x0: { field: "x" }, x1: { field: "x" }, y0: { field: "low" }, y1: { field: "high" } };
      const modes = figure.segment({ ...upright, source: this.modes, line_dash: "dashed" });
      figure.segment({ ...upright, source: this.lines, line_width: 1.8, line_color: { field: "color" } });
      const style = { x: { field: "x" }, y: { field: "y" }, text: { field: "text" }, text_font_size: "11px" };
      const names = figure.text({ ...style, source: this.names, text_align: "center", y_offset: -3 });
      const modeNames = figure.text({ ...style, source: this.modeNames, x_offset: 3, y_offset: 13 });
      return () => {
        modes.glyph.line_color = modeNames.glyph.text_color = ink("soft");
        names.glyph.text_color = ink("ink");
      };
    });
    this.y_scales = { log: new Bokeh.LogScale(), linear: new Bokeh.LinearScale() };
  }

  draw(record, { signal, spin, isLog, isOrder }) {
    const shown = record.spectra.filter((s) => s.name === signal);
    if (!shown.length) return this.say(notKept("spectrum", signal));
    this.say("");
    const rate = isOrder ? 1 : spin / (2 * Math.PI), spacing = record.spacing;
    const top = Math.max(...shown.map((s) => s.top)) || 1;
    const floor = isLog ? top * 1e-5 : 0;
    const data = { x: [], low: [], high: [], color: [] };
    let last = 4.2;
    shown.forEach((s, k) => s.values.forEach((a, i) => {
      if (a > floor) {
        data.x.push((i + 1) * spacing * rate);
        data.low.push(floor);
        data.high.push(a);
        data.color.push(ink(CURVES[k % CURVES.length]));
        if (a > 0.02 * top) last = Math.max(last, 1.15 * (i + 1) * spacing);
      }
    }));
    this.lines.data = data;
    this.figure.y_scale = isLog ? this.y_scales.log : this.y_scales.linear;
    setTicker(this.figure, "y", isLog ? new Bokeh.LogTicker() : new Bokeh.BasicTicker({ desired_num_ticks: 5 }));
    this.figure.yaxis.formatter = isLog ? new Bokeh.LogTickFormatter() : new Bokeh.BasicTickFormatter();
    const end = last * rate;
    setRange(this.figure.x_range, 0, end);
    setRange(this.figure.y_range, floor, isLog ? top * 6 : top * 1.18);
    this.figure.xaxis.axis_label = isOrder ? "Order (multiples of spin speed)" : "Frequency (Hz)";
    this.figure.yaxis.axis_label = `Amplitude (${facts.signals[signal].unit})`;
    const strongest = this.name(shown[0], spacing, rate, end, top);
    this.mark(isOrder ? 2 * Math.PI / spin : 1, end, floor, isLog ? top * 6 : top * 1.18);
    this.heading.textContent = `Spectrum: ${facts.signals[signal].label}`;
    this.describe(strongest.length ? `strongest lines ${strongest.join(", ")}` : "no lines");
  }

  // Name the strongest lines; one too near to a named one for its text to fit goes unnamed.
  name(s, spacing, rate, end, top) {
    const a = s.values;
    const peaks = a.map((_, i) => i).filter((i) => a[i] > 0.02 * top && a[i] > (a[i - 1] ?? 0) && a[i] >= (a[i + 1] ?? 0));
    peaks.sort((i, k) => a[k] - a[i]);
    const named = [];
    for (const i of peaks.slice(0, 8)) {
      if (named.every((k) => Math.abs(i - k) * spacing * rate > 0.075 * end)) named.push(i);
    }
    const text = named.map((i) => orderName((i + 1) * spacing, spacing / 2));
    // Centred over its line, but within the frame.
    const half = (k) => 0.014 * text[k].length * end;
    const x = named.map((i, k) => Math.min(Math.max((i + 1) * spacing * rate, half(k)), end - half(k)));
    this.names.data = { x, y: named.map((i) => a[i]), text };
    return named.map((i, k) => `${text[k]} ${withUnit(a[i], facts.signals[s.name].unit, 3)}`);
  }

  mark(rate, end, floor, top) {
    const inside = Object.entries(facts.frequencies).filter(([, f]) => f * rate < 0.97 * end);
    const x = inside.map(([, f]) => f * rate);
    this.modes.data = { x, low: x.map(() => floor), high: x.map(() => top) };
    // Names that would lie over one another are left out.
    const isClear = x.every((f, i) => x.every((g, k) => i === k || Math.abs(f - g) > 0.16 * end));
    this.modeNames.data = { x: isClear ? x : [], y: isClear ? x.map(() => top) : [], text: isClear ? inside.map(([name]) => name) : [] };
  }
}

class Waveform extends Panel {
  async begin() {
    await this.build({}, (figure) => {
      this.contacts = source({ x0: [], x1: [] });
      this.curves = source({ xs: [], ys: [], color: [] });
      const shade = figure.vstrip({ x0: { field: "x0" }, x1: { field: "x1" }, source: this.contacts, line_color: null, level: "underlay" });
      figure.multi_line({ xs: { field: "xs" }, ys: { field: "ys" }, line_color: { field: "color" }, line_width: 1.3, source: this.curves });
      return () => (shade.glyph.fill_color = ink("shade"));
    });
    setTicker(this.figure, "y", new Bokeh.BasicTicker({ desired_num_ticks: 5 }));
  }

  draw(record, { signal, spin }) {
    const shown = record.waves.filter((w) => w.name === signal);
    if (!shown.length) return this.say(notKept("waveform", signal));
    this.say("");
    const { label, unit } = facts.signals[signal];
    const n = Math.min(shown[0].n, record.shown * record.samples), x = Array.from({ length: n }, (_, i) => i / record.samples);
    this.curves.data = {
      xs: shown.map(() => x), ys: shown.map((w) => w.values.slice(-n)), color: shown.map((_, k) => ink(CURVES[k % CURVES.length])),
    };
    this.contacts.data = this.touches(record, n);
    let low = Infinity, high = -Infinity;
    for (const w of shown) for (const value of w.values.slice(-n)) { low = Math.min(low, value); high = Math.max(high, value); }
    const margin = 0.06 * (high - low || Math.abs(high) || 1);
    setRange(this.figure.x_range, 0, n / record.samples);
    setRange(this.figure.y_range, low - margin, high + margin);
    this.figure.xaxis.axis_label = "Revolutions";
    this.figure.yaxis.axis_label = `${label} (${unit})`;
    this.heading.textContent = "Waveform, contact shaded";
    const seconds = ((n / record.samples) * 2 * Math.PI) / spin;
    this.describe(`${label} over ${written(n / record.samples)} revolutions (${written(1e3 * seconds)} ms), from ${withUnit(low, unit)} to ${withUnit(high, unit)}`);
  }

  touches(record, n) {
    const forces = record.waves.filter((w) => w.name === "contact_force").map((w) => w.values.slice(-n));
    const found = { x0: [], x1: [] };
    if (!forces.length) return found;
    let start = null;
    for (let i = 0; i <= n; i++) {
      const touching = i < n && forces.some((values) => values[i] > 0);
      if (touching && start === null) start = i;
      if (!touching && start !== null) {
        found.x0.push((start - 0.5) / record.samples);
        found.x1.push((i - 0.5) / record.samples);
        start = null;
      }
    }
    return found;
  }
}

function notKept(role, signal) {
  const what = { waveform: "waveforms", spectrum: "spectra", section: "sections" }[role];
  if (facts.kept.includes(role)) return `No ${what} of ${(facts.signals[signal]?.label ?? "this signal").toLowerCase()} here`;
  return `The store contains no ${what}; put "${role}" into [record] keep`;
}
