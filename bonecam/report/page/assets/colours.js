// Colours that colour-blind readers tell apart: viridis (matplotlib), a scale that darkens from bone to brown for
// what is left, a blue-orange one for signed values, and the set of Okabe & Ito (2008) for kinds.
const SCALES = {
  viridis: ["440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b", "fde725"],
  left: ["ece6d8", "f7dd92", "f5b84a", "e58a1f", "c45f0e", "933f0c", "5a2408"],
  signed: ["0a3f73", "2f78b3", "85b7dc", "cfe0ec", "f2f1ee", "f3dcc4", "eda963", "cd6a16", "7e3a05"],
};
const KIND_COLOURS = ["#0072b2", "#e69f00", "#cc79a7", "#009e73", "#d55e00", "#56b4e9", "#f0e442"];
const BONE = "#e6dac2", METAL = "#b9c3cd", CUT = "#a9cfe4";

function rgb(hex) {
  const value = parseInt(hex.replace("#", ""), 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}
const SCALE_STOPS = Object.fromEntries(Object.entries(SCALES).map(([name, list]) => [name, list.map(rgb)]));

function colourAt(scale, share) {
  const stops = SCALE_STOPS[scale];
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(at), stops.length - 2);
  return stops[k].map((value, c) => value + (at - k) * (stops[k + 1][c] - value));
}

function coloursOf(values, scale, low, high) {
  const result = new Float32Array(3 * values.length);
  for (let i = 0; i < values.length; i++) result.set(colourAt(scale, (values[i] - low) / (high - low || 1)), 3 * i);
  return result;
}

// The legend: a scale with ticks and its unit, or a list of [colour, text].
function showLegend(legend) {
  const box = document.getElementById("legend");
  box.replaceChildren();
  if (!legend) return;
  box.append(make("h2", legend.unit ? `${legend.title} (${legend.unit})` : legend.title));
  if (legend.items) {
    for (const [colour, text] of legend.items) {
      const item = make("div", "", "item");
      const swatch = document.createElement("i");
      swatch.style.background = colour;
      item.append(swatch, make("span", text));
      box.append(item);
    }
    return;
  }
  const stops = SCALES[legend.scale].map((hex) => "#" + hex).join(",");
  const bar = make("div", "", "bar");
  bar.style.background = `linear-gradient(to right, ${stops})`;
  const ticks = make("div", "", "ticks");
  for (let k = 0; k <= 4; k++) {
    const tick = make("span", number(legend.low + (k / 4) * (legend.high - legend.low), legend.digits));
    tick.style.left = `${25 * k}%`;
    ticks.append(tick);
  }
  box.append(bar, ticks);
  if (legend.note) box.append(make("p", legend.note));
}

function number(value, digits) {
  return value.toFixed(digits === undefined ? 2 : digits).replace(/^-(?=[0.]*$)/, "").replace("-", "\u2212"); // no minus before a zero
}

function make(tag, text, kind) {
  const element = document.createElement(tag);
  if (text) element.textContent = text;
  if (kind) element.className = kind;
  return element;
}
