// Figures by Bokeh in the page's own colours, light or dark.
const charts = [];

async function loadLibrary() {
  const code = new TextDecoder().decode(await inflate(fromBase64(byId("library").textContent)));
  const script = document.createElement("script");
  script.textContent = code;
  document.head.append(script);
  Bokeh.set_log_level("warn");
}

const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

function makeFigure(options = {}) {
  const figure = Bokeh.Plotting.figure({
    tools: [], toolbar_location: null, sizing_mode: "stretch_both", min_border: 4, min_border_right: 14,
    // Figures above one another have their axes there too.
    min_border_left: 64, min_border_bottom: 44,
    outline_line_width: 1, ...options,
  });
  for (const axis of [figure.xaxis, figure.yaxis]) {
    axis.axis_label_text_font_size = axis.major_label_text_font_size = "12px";
    axis.axis_label_text_font_style = "normal";
    axis.axis_label_standoff = 4;
    axis.minor_tick_line_color = null;
    axis.major_tick_in = 0;
    axis.major_tick_out = 4;
  }
  return figure;
}

// `paint` sets what else has a colour, now and whenever the scheme changes.
async function show(figure, place, paint) {
  const target = place.querySelector(".canvas");
  const chart = { figure, paint, view: null };
  dress(chart);
  chart.view = await Bokeh.Plotting.show(figure, target);
  charts.push(chart);
  return chart;
}

function drop(chart) {
  charts.splice(charts.indexOf(chart), 1);
  chart.view.remove();
}

function dress({ figure, paint }) {
  figure.background_fill_color = null;
  figure.border_fill_color = null;
  figure.outline_line_color = ink("line");
  for (const axis of [figure.xaxis, figure.yaxis]) {
    axis.axis_line_color = axis.major_tick_line_color = ink("soft");
    axis.axis_label_text_color = axis.major_label_text_color = ink("ink");
  }
  figure.xgrid.grid_line_color = figure.ygrid.grid_line_color = ink("grid");
  paint?.();
}

function setTicker(figure, side, ticker) {
  figure[`${side}axis`].ticker = ticker;
  figure[`${side}grid`].ticker = ticker;
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach(dress));

const source = (data) => new Bokeh.ColumnDataSource({ data });

function setRange(range, start, end) {
  range.setv({ start, end, reset_start: start, reset_end: end });
}
