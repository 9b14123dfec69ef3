"use strict";
// Facts and data of the page: in the page itself, or fetched from its server.
const byId = (id) => document.getElementById(id);
const facts = JSON.parse(byId("facts").textContent);
const shape = facts.axes.map((axis) => axis.values.length);
const nCase = shape.reduce((product, n) => product * n, 1);
const variable = Object.fromEntries(facts.variables.map((v) => [v.name, v]));
const FAILED = 2, DIVERGED = 3, MISSING = 0;

function fromBase64(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

async function fetched(path) {
  let answer;
  try {
    answer = await fetch(path);
  } catch {
    throw new Error("rubhpc view does not answer; start it again and reload the page");
  }
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return new Uint8Array(await answer.arrayBuffer());
}

const embedded = {};
for (const id of ["values", "records"]) embedded[id] = JSON.parse(byId(id).textContent);

function remembered(most, make) {
  const known = new Map();
  return (key) => {
    if (!known.has(key)) {
      if (known.size >= most) known.delete(known.keys().next().value);
      const made = make(key);
      made.catch(() => known.delete(key));
      known.set(key, made);
    }
    return known.get(key);
  };
}

// A measure of all cases, SI, in the order of the grid; the stators run fastest.
const valuesOf = remembered(64, async (name) => {
  const bytes = facts.isServed ? await fetched("values/" + name) : fromBase64(embedded.values[name]);
  const planes = new Uint8Array(await inflate(bytes));
  const n = planes.length / 4;
  const whole = new Uint8Array(planes.length);
  for (let i = 0; i < n; i++) for (let k = 0; k < 4; k++) whole[4 * i + k] = planes[k * n + i];
  return new Float32Array(whole.buffer);
});

// From second differences, those below 0 between the others, to what they were taken of.
function unbend(codes) {
  let slope = 0, value = 0;
  codes.forEach((code, i) => {
    slope += code & 1 ? -(code + 1) / 2 : code / 2;
    codes[i] = value += slope;
  });
}

// Waveforms, spectra and sections of one case in display units; null where the page has none.
const recordOf = remembered(200, async (flat) => {
  if (!facts.kept.length) return null;
  const text = embedded.records[flat];
  if (!facts.isServed && text === undefined) return null;
  const buffer = await inflate(facts.isServed ? await fetched("record/" + flat) : fromBase64(text));
  const length = new DataView(buffer).getUint32(0, true);
  const record = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const entries = [...record.waves, ...record.spectra, ...record.section];
  const bytes = new Uint8Array(buffer, 4 + length), n = bytes.length / 2;
  let at = 0;
  for (const entry of entries) {
    const codes = Array.from({ length: entry.n }, (_, i) => bytes[at + i] | (bytes[n + at + i] << 8));
    at += entry.n;
    const { factor } = facts.signals[entry.name];
    if (entry.top !== undefined) {
      entry.top *= factor;
      entry.values = codes.map((q) => (q ? entry.top * 10 ** (5 * (q / 2047 - 1)) : 0));
    } else {
      if (record.waves.includes(entry)) unbend(codes);
      entry.values = codes.map((q) => factor * (entry.low + q * entry.step));
    }
  }
  return record;
});

// Of several stators, the worst: the largest value, or the smallest where that is the worse one.
const WORST = -1;
function worstStator(v, values, flat) {
  let at = 0;
  for (let i = 1; i < facts.nStator; i++) {
    const here = values[flat * facts.nStator + i], best = values[flat * facts.nStator + at];
    if (!Number.isNaN(here) && (Number.isNaN(best) || (v.worst === "smallest" ? here < best : here > best))) at = i;
  }
  return at;
}

// The value of a case: that of one stator, or of the worst.
function valueAt(v, values, flat, stator) {
  if (!v.by_stator) return values[flat];
  return values[flat * facts.nStator + (stator === WORST ? worstStator(v, values, flat) : stator)];
}

const ofStators = (v, stator) => (v.by_stator && facts.nStator > 1 ? (stator === WORST ? `, ${v.worst} of ${facts.nStator} stators` : `, stator ${stator + 1}`) : "");

const flatOf = (at) => at.reduce((flat, i, k) => flat * shape[k] + i, 0);

function placeOf(flat) {
  const at = [];
  for (let k = shape.length - 1; k >= 0; k--) {
    at[k] = flat % shape[k];
    flat = Math.floor(flat / shape[k]);
  }
  return at;
}

function written(x, digits = 4) {
  if (!Number.isFinite(x)) return "–";
  if (x !== 0 && (Math.abs(x) >= 1e6 || Math.abs(x) < 1e-4)) return x.toExponential(digits - 2);
  return String(Number(x.toPrecision(digits)));
}

function withUnit(x, unit, digits = 4) {
  return written(x, digits) + (unit && Number.isFinite(x) ? "\u00a0" + unit : "");
}

function axisValue(axis, i) {
  if (axis.names.length) return axis.names[i];
  return written(axis.values[i], 6) + (axis.unit ? "\u00a0" + axis.unit : "");
}

// A value as people read it: the name of a category, or a number with its unit.
function valueText(v, x) {
  if (v.is_flag) {
    const found = v.categories.find((c) => c.code === x);
    return found ? found.name : "–";
  }
  return withUnit(x * v.factor, v.unit);
}
