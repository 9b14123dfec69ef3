// The map: a measure over two axes of the grid, as cells, or over one, as columns.
const PALETTE = () => Bokeh.Palettes.cividis(256).map((c) => (typeof c === "number" ? "#" + (c >>> 8).toString(16).padStart(6, "0") : c));
// Ground and hatch of what is no value: colour, ink, and a tile of 8 by 8 as lines and dots.
const HATCHES = {
  missing: ["#ededed", "#666666", (c) => { c.beginPath(); c.arc(4, 4, 1.1, 0, 7); c.fill(); }],
  failed: ["#cccccc", "#444444", (c) => { slope(c, 1); slope(c, -1); }],
  diverged: ["#999999", "#222222", (c) => slope(c, 1)],
  beyond: [null, "#d1490b", (c) => slope(c, -1)],
  unsettled: [null, "#d1490b", (c) => { c.fillRect(3.4, 0, 1.1, 8); }],
  empty: ["#ffffff", "#ffffff", () => {}],
};

function slope(context, sign) {
  context.beginPath();
  for (const shift of [-8, 0, 8]) {
    context.moveTo(shift - 1, sign > 0 ? 9 : -1);
    context.lineTo(shift + 9, sign > 0 ? -1 : 9);
  }
  context.stroke();
}

function hatch(context, kind, color, fine) {
  const tile = new OffscreenCanvas(8 * fine, 8 * fine), pen = tile.getContext("2d");
  pen.scale(fine, fine);
  pen.fillStyle = pen.strokeStyle = color;
  pen.lineWidth = 1.1;
  HATCHES[kind][2](pen);
  return context.createPattern(tile, "repeat");
}

const PAINTED = ["known", "beyond", "unsettled"];

class CaseMap {
  constructor(place, onPick) {
    this.place = place;
    this.onPick = onPick;
    this.drawing = Promise.resolve();
  }

  // Draw anew; calls that come while one is under way wait for it.
  draw(state) {
    this.drawing = this.drawing.then(() => this.redraw(state));
    return this.drawing;
  }

  async redraw({ x, y, value, stator, at, isLog }) {
    this.x = facts.axes[x];
    this.y = y === null ? null : facts.axes[y];
    this.iX = x;
    this.iY = y;
    const v = variable[value];
    const [values, status, validity, settled] = await Promise.all(
      [value, "status", "validity", ...(variable.settled ? ["settled"] : [])].map(valuesOf));
    const axes = [x, y].join();
    if (axes !== this.axes) {
      if (this.chart) drop(this.chart);
      this.cells = null;
      await this.build();
      this.axes = axes;
      this.shown = null;
    }
    // Moving on the map changes nothing in it but the mark.
    const rest = at.filter((_, k) => k !== x && k !== y);
    const shown = [value, stator, isLog, ...rest].join();
    if (shown !== this.shown) {
      this.validity = validity;
      const cells = this.describe(v, values, { status, validity, settled }, stator, at);
      this.fill(v, cells, this.colours(v, values, cells, isLog, stator));
      this.shown = shown;
    }
    this.mark(at);
    return this.cells;
  }

  // Every cell by rows from below: its case, its value, and what is to be seen of it.
  describe(v, values, { status, validity, settled }, stator, at) {
    const nX = this.x.values.length, nY = this.y ? this.y.values.length : 1;
    const step = (k) => shape.slice(k + 1).reduce((product, n) => product * n, 1);
    const base = at.slice();
    base[this.iX] = 0;
    if (this.y) base[this.iY] = 0;
    const start = flatOf(base), across = step(this.iX), up = this.y ? step(this.iY) : 0;
    const cells = { nX, nY, flat: [], value: [], kind: [], color: [], constant: null };
    const isKnown = v.name === "status" || v.is_setting;
    for (let j = 0; j < nY; j++) {
      for (let i = 0; i < nX; i++) {
        const flat = start + this.x.order[i] * across + (this.y ? this.y.order[j] * up : 0);
        const value = valueAt(v, values, flat, stator), state = status[flat];
        cells.flat.push(flat);
        cells.value.push(value);
        cells.kind.push(isKnown ? "known"
          : state === MISSING ? "missing" : state === FAILED ? "failed" : state === DIVERGED ? "diverged"
          : !Number.isFinite(value) ? "empty" : validity[flat] > 0 && v.name !== "validity" ? "beyond"
          : settled?.[flat] === 0 && v.name !== "settled" ? "unsettled" : "known");
      }
    }
    return cells;
  }

  tip(i, j) {
    const { v, validity, cells } = this, n = j * cells.nX + i, kind = cells.kind[n];
    const where = [`${this.x.label} ${axisValue(this.x, this.x.order[i])}`];
    if (this.y) where.push(`${this.y.label} ${axisValue(this.y, this.y.order[j])}`);
    const what = PAINTED.includes(kind) ? `${v.label}: ${valueText(v, cells.value[n])}` : kind === "empty" ? "no value" : kind;
    const mark = kind === "beyond" ? `\nout of range: ${facts.validity[validity[cells.flat[n]]]}` : kind === "unsettled" ? "\nnot settled" : "";
    return `${where.join(", ")}\n${what}${mark}`;
  }

  // Colours run over the whole study, so that they mean the same whatever the other axes are set to.
  colours(v, values, cells, isLog, stator) {
    const painted = (i) => PAINTED.includes(cells.kind[i]);
    const color = cells.kind.map((kind, i) => (painted(i) ? null : HATCHES[kind][0]));
    if (v.is_flag) {
      const of = new Map(v.categories.map((c) => [c.code, c.color]));
      cells.color = color.map((c, i) => c ?? of.get(cells.value[i]) ?? "#ffffff");
      return null;
    }
    let low = Infinity, high = -Infinity;
    const shown = v.by_stator && stator === WORST ? Array.from({ length: nCase }, (_, flat) => valueAt(v, values, flat, WORST)) : values;
    for (const x of shown) {
      if (Number.isFinite(x) && (!isLog || x > 0)) {
        if (x < low) low = x;
        if (x > high) high = x;
      }
    }
    if (!(high >= low)) { low = 0; high = 1; }
    if (low === high) cells.constant = low * v.factor;
    const on = isLog ? (x) => Math.log(x) : (x) => x;
    const palette = PALETTE(), span = on(high) - on(low) || 1;
    cells.color = color.map((c, i) => {
      if (c) return c;
      const share = (on(cells.value[i]) - on(low)) / span;
      return palette[Number.isFinite(share) ? Math.max(0, Math.min(255, Math.round(255 * share))) : 0];
    });
    return { low: low * v.factor, high: high * v.factor, palette, isLog };
  }

  async build() {
    const label = (axis) => axis.label + (axis.unit ? ` (${axis.unit})` : "");
    const figure = makeFigure({
      x_range: new Bokeh.Range1d({ start: this.x.edges[0], end: this.x.edges.at(-1) }),
      y_range: new Bokeh.Range1d({ start: 0, end: 1 }),
      x_axis_type: this.x.is_log ? "log" : "linear",
      y_axis_type: this.y?.is_log ? "log" : "linear",
      x_axis_label: label(this.x),
    });
    figure.xgrid.visible = figure.ygrid.visible = false;
    for (const [axis, bokeh] of [[this.x, figure.xaxis], [this.y, figure.yaxis]]) {
      if (axis && axis.values.length <= 10) bokeh.ticker = new Bokeh.FixedTicker({ ticks: axis.order.map((i) => axis.values[i]) });
      bokeh.formatter = new Bokeh.BasicTickFormatter({ use_scientific: false });
      bokeh.major_label_policy = new Bokeh.NoOverlap({ min_distance: 3 }); // values close together keep their ticks
      if (axis?.names.length) bokeh.major_label_overrides = new Map(axis.names.map((name, i) => [axis.values[i], name]));
    }
    if (this.y) {
      figure.yaxis.axis_label = label(this.y);
      setRange(figure.y_range, this.y.edges[0], this.y.edges.at(-1));
    }
    this.picture = source({ url: [], x: [], y: [], w: [], h: [] });
    this.markSource = source({ left: [], right: [], bottom: [], top: [] });
    const field = (name) => ({ field: name });
    figure.image_url({ url: field("url"), x: field("x"), y: field("y"), w: field("w"), h: field("h"), anchor: "bottom_left", source: this.picture });
    const box = { left: field("left"), right: field("right"), bottom: field("bottom"), top: field("top"), fill_color: null };
    figure.quad({ ...box, line_color: "#ffffff", line_width: 5, source: this.markSource });
    figure.quad({ ...box, line_color: "#111111", line_width: 2.4, source: this.markSource });
    figure.on_event("tap", (event) => this.pick(event.x, event.y));
    figure.on_event("mousemove", (event) => this.hover(event));
    figure.on_event("mouseleave", () => (byId("tip").hidden = true));
    for (const side of ["inner_width", "inner_height"]) figure.properties[side].change.connect(() => this.paint());
    this.figure = figure;
    this.chart = await show(figure, this.place, () => this.bar && this.paintBar());
  }

  fill(v, cells, scale) {
    Object.assign(this, { v, cells });
    this.heights = this.y ? null : this.columns(v, cells);
    this.paint();
    this.colourBar(v, scale);
  }

  // Columns start at zero; what has no height fills the figure.
  columns(v, cells) {
    const heights = cells.value.map((x, i) => (v.is_flag || !PAINTED.includes(cells.kind[i]) ? NaN : x * v.factor));
    const finite = heights.filter(Number.isFinite);
    const high = Math.max(0, ...finite), low = Math.min(0, ...finite), span = high - low || 1;
    setRange(this.figure.y_range, low < 0 ? low - 0.05 * span : 0, high + 0.05 * span);
    this.figure.yaxis.axis_label = v.is_flag ? "" : v.label + (v.unit ? ` (${v.unit})` : "");
    this.figure.yaxis.visible = !v.is_flag;
    return heights;
  }

  // The cells as a picture, as fine as the screen: a study may have a hundred thousand of them.
  paint() {
    const { cells, figure } = this;
    const { inner_width: width, inner_height: height } = figure;
    if (!cells || !width || !height) return;
    const fine = Math.min(devicePixelRatio || 1, 3);
    const canvas = document.createElement("canvas");
    canvas.width = Math.round(width * fine);
    canvas.height = Math.round(height * fine);
    const context = canvas.getContext("2d");
    const along = (edges, isLog, size) => {
      const on = isLog ? Math.log : (x) => x, first = on(edges[0]), last = on(edges.at(-1));
      return edges.map((edge) => Math.round((size * (on(edge) - first)) / (last - first)));
    };
    const x = along(this.x.edges, this.x.is_log, canvas.width);
    const range = figure.y_range, y = this.y ? along(this.y.edges, this.y.is_log, canvas.height) : [0, canvas.height];
    const level = (value) => (canvas.height * (value - range.start)) / (range.end - range.start);
    const patterns = Object.fromEntries(Object.keys(HATCHES).map((kind) =>
      [kind, hatch(context, kind, ["beyond", "unsettled"].includes(kind) && this.v.is_flag ? "#111111" : HATCHES[kind][1], fine)]));
    for (let j = 0; j < cells.nY; j++) {
      for (let i = 0; i < cells.nX; i++) {
        const n = j * cells.nX + i, h = this.heights?.[n];
        const [low, high] = Number.isFinite(h) ? [level(Math.min(h, 0)), level(Math.max(h, 0))] : [y[j], y[j + 1]];
        const box = [x[i], canvas.height - high, Math.max(x[i + 1] - x[i], 1), Math.max(high - low, 1)];
        context.fillStyle = cells.color[n];
        context.fillRect(...box);
        if (cells.kind[n] !== "known") {
          context.fillStyle = patterns[cells.kind[n]];
          context.fillRect(...box);
        }
      }
    }
    const left = this.x.edges[0], bottom = range.start;
    this.picture.data = { url: [canvas.toDataURL()], x: [left], y: [bottom], w: [this.x.edges.at(-1) - left], h: [range.end - bottom] };
  }

  colourBar(v, scale) {
    const wanted = scale && this.y && scale.low < scale.high; // a single number is in the legend
    if (this.bar) this.bar.visible = false;
    if (!wanted) return;
    const mapper = new (scale.isLog ? Bokeh.LogColorMapper : Bokeh.LinearColorMapper)({
      palette: scale.palette, low: scale.low, high: scale.high,
    });
    if (this.bar && this.barFigure === this.figure && this.barIsLog === scale.isLog) {
      this.bar.color_mapper = mapper;
      this.bar.visible = true;
      this.bar.title = v.label + (v.unit ? ` (${v.unit})` : "");
    } else {
      this.bar = new Bokeh.ColorBar({
        color_mapper: mapper, title: v.label + (v.unit ? ` (${v.unit})` : ""), orientation: "horizontal", height: 12,
        padding: 4, title_text_font_style: "normal", title_text_font_size: "12px", major_label_text_font_size: "11px",
        background_fill_color: null, bar_line_color: null,
      });
      this.barFigure = this.figure;
      this.barIsLog = scale.isLog;
      this.figure.add_layout(this.bar, "above");
    }
    this.paintBar();
  }

  paintBar() {
    this.bar.title_text_color = this.bar.major_label_text_color = ink("ink");
    this.bar.major_tick_line_color = ink("card");
  }

  mark(at) {
    const i = this.x.order.indexOf(at[this.iX]);
    const j = this.y ? this.y.order.indexOf(at[this.iY]) : 0;
    const range = this.figure.y_range;
    this.markSource.data = {
      left: [this.x.edges[i]], right: [this.x.edges[i + 1]],
      bottom: [this.y ? this.y.edges[j] : range.start], top: [this.y ? this.y.edges[j + 1] : range.end],
    };
  }

  // Which cell holds a point, by its place along each axis.
  cellAt(x, y) {
    const along = (edges, value) => Math.min(Math.max(edges.findIndex((edge) => edge > value), 1), edges.length - 1) - 1;
    const last = (edges, value) => (value >= edges.at(-1) ? edges.length - 2 : along(edges, value));
    return [last(this.x.edges, x), this.y ? last(this.y.edges, y) : 0];
  }

  pick(x, y) {
    const [i, j] = this.cellAt(x, y);
    this.onPick({ [this.iX]: this.x.order[i], ...(this.y ? { [this.iY]: this.y.order[j] } : {}) });
  }

  hover({ x, y, sx, sy }) {
    const tip = byId("tip"), frame = this.chart.view?.frame.bbox;
    if (!frame || !this.cells || sx < frame.left || sx > frame.right || sy < frame.top || sy > frame.bottom) {
      tip.hidden = true;
      return;
    }
    tip.textContent = this.tip(...this.cellAt(x, y));
    tip.hidden = false;
    const room = this.place.clientWidth - tip.offsetWidth;
    tip.style.left = `${Math.max(0, Math.min(sx + 14, room))}px`;
    tip.style.top = `${sy + 18}px`;
  }
}
