// What is chosen, the controls that choose it, and what follows from it.
const state = { at: shape.map(() => 0), value: null, x: null, y: null, stator: WORST, isLog: false, signal: null, isLogSpectrum: false, isOrder: false };
const panels = {};
let map = null;

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name in made && name !== "list") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

let nField = 0;

function choice(label, options, chosen, onChange) {
  const id = `field-${nField++}`;
  const select = element("select", { id }, ...options.map(([value, text]) => element("option", { value, textContent: text })));
  select.value = chosen;
  select.addEventListener("change", () => onChange(select.value));
  return element("div", { className: "field" }, element("label", { htmlFor: id }, label), select);
}

function check(label, isOn, onChange) {
  const id = `field-${nField++}`;
  const box = element("input", { type: "checkbox", checked: isOn, id });
  box.addEventListener("change", () => onChange(box.checked));
  return element("div", { className: "check" }, box, element("label", { htmlFor: id }, label));
}

function setAxes(x, y) {
  if (x === y) [x, y] = [y, x === state.x ? state.y : state.x];
  state.x = x;
  state.y = y;
}

function buildControls() {
  const place = byId("controls");
  const several = facts.free.map((name) => [facts.axes.findIndex((a) => a.name === name), name]).map(([k]) => [String(k), facts.axes[k].label]);
  place.replaceChildren(choice("Show", facts.variables.map((v) => [v.name, v.label]), state.value, (value) => update({ value })));
  const swap = (which) => (k) => {
    const other = which === "x" ? "y" : "x";
    const old = state[which];
    state[which] = Number(k);
    if (state[other] === Number(k)) state[other] = old;
    buildControls();
    update({});
  };
  if (several.length > 1) {
    place.append(choice("Across", several, String(state.x), swap("x")), choice("Up", several, String(state.y), swap("y")));
  }
  if (facts.nStator > 1) {
    const numbers = [[String(WORST), "Worst stator"], ...Array.from({ length: facts.nStator }, (_, i) => [String(i), `Stator ${i + 1}`])];
    place.append(choice("Of", numbers, String(state.stator), (i) => update({ stator: Number(i) })));
  }
  if (facts.free.length > 1) place.append(check("Logarithmic colours", state.isLog, (isLog) => update({ isLog })));
  byId("panel-controls").replaceChildren(
    choice("Signal of spectrum and waveform", Object.entries(facts.signals).map(([name, { label }]) => [name, label]), state.signal, (signal) => update({ signal })),
    check("Logarithmic amplitudes", state.isLogSpectrum, (isLogSpectrum) => update({ isLogSpectrum })),
    check("Orders instead of Hz", state.isOrder, (isOrder) => update({ isOrder })),
  );
}

function buildSliders() {
  const place = byId("sliders");
  facts.axes.forEach((axis, k) => {
    if (axis.values.length < 2) return;
    const output = element("span", { className: "value" });
    const slider = element("input", { type: "range", min: 0, max: axis.values.length - 1, step: 1, id: `axis-${k}` });
    slider.addEventListener("input", () => move({ [k]: axis.order[Number(slider.value)] }));
    place.append(element("div", {}, element("label", { htmlFor: slider.id }, axis.label), output, slider));
    axis.slider = slider;
    axis.output = output;
  });
  place.hidden = !place.children.length;
}

function move(places) {
  for (const [k, i] of Object.entries(places)) state.at[k] = i;
  return update({});
}

// Arrow keys move on the map, by cells.
function onKey(event) {
  const across = facts.axes[state.x], up = state.y === null ? null : facts.axes[state.y];
  const step = (axis, k, by) => {
    if (!axis) return null;
    const next = Math.min(Math.max(axis.order.indexOf(state.at[k]) + by, 0), axis.values.length - 1);
    return { [k]: axis.order[next] };
  };
  const moves = {
    ArrowLeft: () => step(across, state.x, -1), ArrowRight: () => step(across, state.x, 1),
    ArrowDown: () => step(up, state.y, -1), ArrowUp: () => step(up, state.y, 1),
    Home: () => step(across, state.x, -Infinity), End: () => step(across, state.x, Infinity),
    PageDown: () => step(up, state.y, -Infinity), PageUp: () => step(up, state.y, Infinity),
  };
  const found = moves[event.key]?.();
  if (!found || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  move(found);
}

const caseWords = () => facts.axes.map((axis, k) => `${axis.label.toLowerCase()} ${axisValue(axis, state.at[k])}`).join(", ");

// Updates follow one another; of those that wait, only the last is drawn.
let updating = false, again = false;
async function update(changes) {
  Object.assign(state, changes);
  if (updating) { again = true; return; }
  updating = true;
  const slow = setTimeout(() => { byId("loading").hidden = false; }, 200); // ms, below which nothing needs to be said
  do {
    again = false;
    try {
      await redraw();
    } catch (error) {
      byId("broken").textContent = error.message;
      byId("broken").hidden = false;
    }
  } while (again);
  updating = false;
  clearTimeout(slow);
  byId("loading").hidden = true;
  document.body.dataset.ready = String(flatOf(state.at));
}

async function redraw() {
  const flat = flatOf(state.at);
  byId("broken").hidden = true;
  facts.axes.forEach((axis, k) => {
    if (!axis.slider) return;
    axis.slider.value = axis.order.indexOf(state.at[k]);
    axis.slider.setAttribute("aria-valuetext", axisValue(axis, state.at[k]));
    axis.output.textContent = axisValue(axis, state.at[k]);
  });
  if (map) {
    const cells = await map.draw({ ...state, at: state.at.slice() });
    drawLegend(variable[state.value], cells);
  }
  await drawCase(flat);
  rememberPlace();
}

function drawLegend(v, cells) {
  const kinds = new Set(cells.kind);
  const words = { beyond: "out of the model's range", unsettled: "not settled", missing: "missing", failed: "failed", diverged: "diverged", empty: "no value" };
  const present = new Set(cells.value);
  const swatches = v.categories.filter((c) => present.has(c.code)).map((c) => {
    const swatch = element("i");
    swatch.style.background = c.color;
    return element("span", {}, swatch, c.name);
  });
  for (const [kind, text] of Object.entries(words)) {
    if (kinds.has(kind)) swatches.push(element("span", {}, element("i", { className: ["beyond", "unsettled"].includes(kind) && v.is_flag ? `${kind} dark` : kind }), text));
  }
  if (cells.constant !== null) swatches.push(element("span", {}, `${withUnit(cells.constant, v.unit)} in all cases`));
  byId("legend").replaceChildren(...swatches);
  byId("map-title").textContent = v.label + ofStators(v, state.stator);
}

async function drawCase(flat) {
  const status = (await valuesOf("status"))[flat], validity = (await valuesOf("validity"))[flat];
  const spin = variable.spin_speed ? (await valuesOf("spin_speed"))[flat] : NaN;
  const words = await caseTable(flat);
  const meaning = ["not computed yet", "done", "failed", "diverged", "inferred from the cases around it"][status];
  const reason = facts.reasons[flat] ? `: ${facts.reasons[flat]}` : "";
  const range = status === 1 ? (validity > 0 ? `; out of the model's range: ${facts.validity[validity]}` : "; within the model's range") : "";
  byId("case-text").textContent = `${caseWords() || "The only case"} – ${status === 1 ? words : meaning + reason}${range}`.replace(/^./, (c) => c.toUpperCase());
  const record = status === 1 ? await recordOf(flat) : null;
  if (!record) {
    const why = status !== 1 ? `This case ${status === 0 || status === 4 ? "is" : "has"} ${meaning}${reason}`
      : `Left out to limit the size of this page; run rubhpc view ${facts.store}`;
    for (const panel of Object.values(panels)) panel.say(why);
    return;
  }
  panels.orbit.draw(record, await clearanceOf(flat));
  panels.section.draw(record);
  panels.spectrum.draw(record, { signal: state.signal, spin, isLog: state.isLogSpectrum, isOrder: state.isOrder });
  panels.waveform.draw(record, { signal: state.signal, spin });
}

// The clearance, m: a setting of the case, or an axis of the study.
async function clearanceOf(flat) {
  if (variable.clearance) return (await valuesOf("clearance"))[flat];
  const k = facts.axes.findIndex((axis) => axis.name === "clearance");
  return k < 0 ? 0 : Number(facts.axes[k].typed[state.at[k]]);
}

// Fill the table of measures; what matters most in words.
async function caseTable(flat) {
  const said = [];
  const rows = [];
  for (const v of facts.variables) {
    const values = await valuesOf(v.name);
    const text = valueText(v, valueAt(v, values, flat, v.by_stator ? state.stator : 0));
    const worst = valueText(v, valueAt(v, values, flat, WORST));
    const isRing = v.by_stator && facts.nStator > 1;
    const cell = element("td", { className: "number" }, ...(isRing ? stators(v, values, flat, worst) : [worst]));
    rows.push(element("tr", {}, element("th", { scope: "row", textContent: v.label + ofStators(v, WORST) }), cell));
    if (v.name === "regime" && text === "periodic") said.push(`regime periodic${await periodNote(flat)}`);
    else if (["regime", "peak_contact_force", "peak_torsion"].includes(v.name) || v.name === state.value) said.push(`${v.label.toLowerCase()} ${text}${ofStators(v, state.stator).replace(/^, (.*)/, " ($1)")}`);
    if (facts.isServed && !v.by_stator && rows.length > 40) break;
  }
  byId("case-table").replaceChildren(element("tbody", {}, ...rows));
  return said.join(", ");
}

// What a periodic motion without a period is.
async function periodNote(flat) {
  if (!variable.period || (await valuesOf("period"))[flat] !== 0) return "";
  const isSettling = variable.settled && (await valuesOf("settled"))[flat] === 0;
  return isSettling ? " once settled" : `, with a longer period than ${facts.longestPeriod} revolutions`;
}

// The worst value; behind it those of all stators, the worst first, and last those without any.
function stators(v, values, flat, worst) {
  const own = Array.from({ length: facts.nStator }, (_, i) => [i + 1, values[flat * facts.nStator + i]]);
  if (own.every(([, x]) => Number.isNaN(x) || x === own[0][1])) return [worst];
  const sign = v.worst === "smallest" ? 1 : -1;
  own.sort(([i, x], [k, y]) => Number.isNaN(x) - Number.isNaN(y) || sign * (x - y) || i - k);
  const list = own.map(([i, x]) => element("li", {}, `stator ${i}: ${valueText(v, x)}`));
  return [element("details", {}, element("summary", {}, `${worst}, stator ${own[0][0]}`), element("ol", {}, ...list))];
}

// The state of the page is in its address, so that a link restores it.
function rememberPlace() {
  const text = new URLSearchParams({ at: state.at.join("."), show: state.value, across: state.x ?? "", up: state.y ?? "" });
  history.replaceState(null, "", "#" + text);
}

function recallPlace() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const at = (asked.get("at") ?? "").split(".").map(Number);
  if (at.length === shape.length && at.every((i, k) => Number.isInteger(i) && i >= 0 && i < shape[k])) state.at = at;
  if (variable[asked.get("show")]) state.value = asked.get("show");
  const free = facts.free.map((name) => String(facts.axes.findIndex((a) => a.name === name)));
  if (free.includes(asked.get("across")) && free.includes(asked.get("up")) && asked.get("across") !== asked.get("up")) {
    state.x = Number(asked.get("across"));
    state.y = Number(asked.get("up"));
  }
}

async function startAt() {
  const status = await valuesOf("status");
  let flat = [...status.keys()].find((i) => status[i] === 1) ?? 0;
  const shown = facts.isServed ? null : Object.keys(embedded.records).map(Number);
  if (shown?.length) flat = shown[Math.floor(shown.length / 2)];
  // Among those that rub: there is more to be seen than in a circle.
  const force = variable.peak_contact_force;
  if (force) {
    const forces = await valuesOf(force.name);
    const rubs = (shown?.length ? shown : [...status.keys()].filter((i) => status[i] === 1)).filter((i) => valueAt(force, forces, i, WORST) > 0);
    if (rubs.length) flat = rubs[Math.floor(rubs.length / 2)];
  }
  state.at = placeOf(flat);
  const axes = facts.free.slice(0, 2).map((name) => facts.axes.findIndex((a) => a.name === name));
  // The speed runs across, wherever it is in the grid.
  axes.sort((i, k) => facts.axes[k].name.startsWith("speed") - facts.axes[i].name.startsWith("speed"));
  [state.x = null, state.y = null] = axes;
  const first = ["regime", "peak_contact_force", "status"];
  if (state.y === null) first.unshift("peak_contact_force");
  if (!status.includes(1)) first.unshift("status");
  state.value = first.find((name) => variable[name]);
  state.signal = Object.keys(facts.signals).includes("torsion") ? "torsion" : Object.keys(facts.signals)[0] ?? "";
}

async function begin() {
  byId("loading").hidden = false;
  await loadLibrary();
  await startAt();
  recallPlace();
  buildControls();
  buildSliders();
  Object.assign(panels, { orbit: new Orbit("orbit"), section: new Section("section"), spectrum: new Spectrum("spectrum"), waveform: new Waveform("waveform") });
  for (const panel of Object.values(panels)) await panel.begin();
  if (!facts.kept.length) {
    byId("right").replaceChildren(element("p", { className: "note", textContent: facts.isRunUp ? "The pictures above show the revolutions of each case; its waveforms are in the store: rubhpc orbit, bode, polar and waterfall draw them." : "The store contains only measures, no waveforms, spectra or sections. To see orbits, run the study with [record] keep = [\"waveform\"]." }));
    for (const name of Object.keys(panels)) delete panels[name];
  }
  if (state.x === null) {
    byId("map-card").hidden = true;
    byId("controls").hidden = true;
  } else {
    byId("map").classList.toggle("low", state.y === null);
    map = new CaseMap(byId("map"), move);
    byId("map").addEventListener("keydown", onKey);
  }
  for (const button of document.querySelectorAll(".goto")) {
    button.addEventListener("click", () => {
      if (variable[button.dataset.value]) state.value = button.dataset.value;
      buildControls();
      move(placeOf(Number(button.dataset.flat)));
      byId("explore").scrollIntoView();
    });
  }
  await update({});
  // What the figures showed before they had any data would stay behind at their edges.
  for (const { view } of charts) view.request_layout();
}

begin().catch((error) => {
  byId("loading").hidden = true;
  byId("broken").textContent = `The maps cannot be drawn: ${error.message}`;
  byId("broken").hidden = false;
});
