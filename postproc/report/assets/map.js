// The map: a measure over two axes of the grid, as cells, or over one, as columns.
const PALETTE = () => Bokeh.Palettes.cividis(256).map((c) => (typeof c === "number" ? "#" + (c >>> 8).toString(16).padStart(6, "0") : c));
const HATCHES = {
  missing: ["#ededed", "dot", "#555555"],
  failed: ["#cccccc", "diagonal_cross", "#444444"],
  diverged: ["#999999", "right_diagonal_line", "#222222"],
  empty: ["#ffffff", " ", "#ffffff"],
};

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
    this.x = told.axes[x];
    this.y = y === null ? null : told.axes[y];
    this.iX = x;
    this.iY = y;
    const v = variable[value];
    const [values, status, validity] = await Promise.all([valuesOf(value), valuesOf("status"), valuesOf("validity")]);
    const cells = this.cells(v, values, status, validity, stator, at);
    const scale = this.colours(v, values, cells, isLog);
    const key = [x, y, y === null ? value : "", isLog && y === null].join();
    if (key !== this.key) {
      if (this.chart) drop(this.chart);
      await this.build(v, cells);
      this.key = key;
    }
    this.fill(v, cells, scale);
    this.mark(at);
    return cells;
  }

  // Edges of every cell, its case, and what is to be seen of it.
  cells(v, values, status, validity, stator, at) {
    const nX = this.x.values.length, nY = this.y ? this.y.values.length : 1;
    const stride = v.by_stator ? told.nStator : 1;
    const cells = { flat: [], value: [], kind: [], left: [], right: [], bottom: [], top: [], tip: [] };
    const place = at.slice();
    for (let j = 0; j < nY; j++) {
      for (let i = 0; i < nX; i++) {
        place[this.iX] = this.x.order[i];
        if (this.y) place[this.iY] = this.y.order[j];
        const flat = flatOf(place);
        const value = values[flat * stride + (v.by_stator ? stator : 0)];
        const state = status[flat];
        const isKnown = v.name === "status" || v.is_setting;
        const kind = isKnown ? "known"
          : state === MISSING ? "missing" : state === FAILED ? "failed" : state === DIVERGED ? "diverged"
          : !Number.isFinite(value) ? "empty" : validity[flat] > 0 && v.name !== "validity" ? "beyond" : "known";
        cells.flat.push(flat);
        cells.value.push(value);
        cells.kind.push(kind);
        cells.left.push(this.x.edges[i]);
        cells.right.push(this.x.edges[i + 1]);
        cells.bottom.push(this.y ? this.y.edges[j] : 0);
        cells.top.push(this.y ? this.y.edges[j + 1] : this.height(v, value, kind));
        const where = [`${this.x.label} ${axisValue(this.x, this.x.order[i])}`];
        if (this.y) where.push(`${this.y.label} ${axisValue(this.y, this.y.order[j])}`);
        const what = kind === "known" || kind === "beyond" ? `${v.label}: ${valueText(v, value)}` : kind === "empty" ? "no value" : kind;
        cells.tip.push(`${where.join(", ")}; ${what}${kind === "beyond" ? " (out of range: " + told.validity[validity[flat]] + ")" : ""}`);
      }
    }
    return cells;
  }

  height(v, value, kind) {
    return v.is_flag || !["known", "beyond"].includes(kind) ? NaN : value * v.factor;
  }

  // Colours run over the whole study, so that they mean the same wherever the other axes stand.
  colours(v, values, cells, isLog) {
    const painted = (i) => cells.kind[i] === "known" || cells.kind[i] === "beyond";
    const color = cells.kind.map((kind, i) => (painted(i) ? null : HATCHES[kind][0]));
    if (v.is_flag) {
      const of = new Map(v.categories.map((c) => [c.code, c.color]));
      cells.color = color.map((c, i) => c ?? of.get(cells.value[i]) ?? "#ffffff");
      return null;
    }
    let low = Infinity, high = -Infinity;
    for (const x of values) {
      if (Number.isFinite(x) && (!isLog || x > 0)) {
        if (x < low) low = x;
        if (x > high) high = x;
      }
    }
    if (!(high >= low)) { low = 0; high = 1; }
    const on = isLog ? (x) => Math.log(x) : (x) => x;
    const palette = PALETTE(), span = on(high) - on(low) || 1;
    cells.color = color.map((c, i) => {
      if (c) return c;
      const share = (on(cells.value[i]) - on(low)) / span;
      return palette[Number.isFinite(share) ? Math.max(0, Math.min(255, Math.round(255 * share))) : 0];
    });
    return { low: low * v.factor, high: high * v.factor, palette, isLog };
  }

  async build(v, cells) {
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
    }
    if (this.y) {
      figure.yaxis.axis_label = label(this.y);
      setRange(figure.y_range, this.y.edges[0], this.y.edges.at(-1));
    }
    this.cellSource = source({ left: [], right: [], bottom: [], top: [], color: [], tip: [] });
    this.hatchSource = source({ left: [], right: [], bottom: [], top: [], pattern: [], color: [] });
    this.markSource = source({ left: [], right: [], bottom: [], top: [] });
    const box = { left: { field: "left" }, right: { field: "right" }, bottom: { field: "bottom" }, top: { field: "top" } };
    const drawn = figure.quad({ ...box, fill_color: { field: "color" }, line_color: { field: "color" }, line_width: 0.6, source: this.cellSource });
    figure.quad({
      ...box, fill_color: null, line_color: null, hatch_pattern: { field: "pattern" }, hatch_color: { field: "color" },
      hatch_scale: 9, hatch_weight: 1.2, source: this.hatchSource,
    });
    figure.quad({ ...box, fill_color: null, line_color: "#ffffff", line_width: 5, source: this.markSource });
    figure.quad({ ...box, fill_color: null, line_color: "#111111", line_width: 2.4, source: this.markSource });
    figure.add_tools(new Bokeh.HoverTool({ renderers: [drawn], tooltips: [["", "@tip"]], point_policy: "follow_mouse" }));
    figure.on_event("tap", (event) => this.pick(event.x, event.y));
    this.figure = figure;
    this.chart = await show(figure, this.place, () => this.bar && this.paintBar());
  }

  fill(v, cells, scale) {
    this.shown = cells;
    if (!this.y) this.fitColumns(v, cells);
    const { left, right, bottom, top, color, tip } = cells;
    this.cellSource.data = { left, right, bottom, top, color, tip };
    const hatched = cells.kind.map((kind, i) => i).filter((i) => cells.kind[i] !== "known" && cells.kind[i] !== "empty");
    const pick = (column) => hatched.map((i) => column[i]);
    const warning = v.is_flag ? "#111111" : "#d1490b";
    this.hatchSource.data = {
      left: pick(left), right: pick(right), bottom: pick(bottom), top: pick(top),
      pattern: hatched.map((i) => (cells.kind[i] === "beyond" ? "left_diagonal_line" : HATCHES[cells.kind[i]][1])),
      color: hatched.map((i) => (cells.kind[i] === "beyond" ? warning : HATCHES[cells.kind[i]][2])),
    };
    this.colourBar(v, scale);
  }

  // Columns stand on zero; what has no height fills the figure.
  fitColumns(v, cells) {
    const heights = cells.top.filter(Number.isFinite);
    const high = Math.max(0, ...heights), low = Math.min(0, ...heights);
    const span = high - low || 1;
    const [start, end] = [low < 0 ? low - 0.05 * span : 0, high + 0.05 * span];
    setRange(this.figure.y_range, start, end);
    cells.bottom = cells.top.map((t) => (Number.isFinite(t) ? Math.min(t, 0) : start));
    cells.top = cells.top.map((t) => (Number.isFinite(t) ? Math.max(t, 0) : end));
    this.figure.yaxis.axis_label = v.is_flag ? "" : v.label + (v.unit ? ` (${v.unit})` : "");
    this.figure.yaxis.visible = !v.is_flag;
  }

  colourBar(v, scale) {
    const wanted = scale && this.y;
    if (this.bar) this.bar.visible = false;
    if (!wanted) return;
    const mapper = new (scale.isLog ? Bokeh.LogColorMapper : Bokeh.LinearColorMapper)({
      palette: scale.palette, low: scale.low, high: scale.high === scale.low ? scale.low + 1 : scale.high,
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

  pick(x, y) {
    const cell = (edges, value) => Math.min(Math.max(edges.findIndex((edge) => edge > value) - 1, 0), edges.length - 2);
    const found = { [this.iX]: this.x.order[x >= this.x.edges.at(-1) ? this.x.edges.length - 2 : cell(this.x.edges, x)] };
    if (this.y) found[this.iY] = this.y.order[y >= this.y.edges.at(-1) ? this.y.edges.length - 2 : cell(this.y.edges, y)];
    this.onPick(found);
  }
}
