// Ways through the program: graphs of feed and rotary axes under the slider, and the search for a block.
const TRACK_HEIGHT = 26, TRACK_COLOURS = ["#0072b2", "#d55e00", "#009e73"];

// What is drawn: values of every move, NaN where there is none (the feed of a rapid), with their least and greatest.
function tracksOf() {
  const feed = page.arrays.move_feed, names = page.facts.program.rotary || []; // folders kept by earlier versions have none
  const columns = names.map((name) => ({ name, unit: "°", digits: 1, values: page.arrays[`move_angle_${name}`] }));
  const tracks = [{ name: "feed", unit: " mm/min", digits: 0, values: feed.map((value) => (value > 0 ? value : NaN)) }, ...columns];
  for (const track of tracks) {
    track.low = Infinity; track.high = -Infinity;
    for (const value of track.values) { if (value < track.low) track.low = value; if (value > track.high) track.high = value; }
  }
  return tracks.filter((track) => track.low <= track.high);
}

// Least and greatest value of the moves that fall on each of `width` columns; `shares` are their places, 0 to 1.
function extremes(values, shares, width) {
  const low = new Float32Array(width).fill(Infinity), high = new Float32Array(width).fill(-Infinity);
  for (let i = 0; i < values.length; i++) {
    const column = Math.min(width - 1, Math.floor(shares[i] * width)), value = values[i];
    if (value < low[column]) low[column] = value;
    if (value > high[column]) high[column] = value;
  }
  return { low, high };
}

// The place of each move on the graph: by its number, or by the time in feed.
function sharesOf(over) {
  const minutes = page.arrays.move_minute, last = minutes.length - 1;
  const whole = minutes[last] - minutes[0];
  const timed = over === "time" && whole > 0, shares = new Float32Array(minutes.length);
  for (let i = 0; i <= last; i++) shares[i] = timed ? (minutes[i] - minutes[0]) / whole : i / Math.max(last, 1);
  return shares;
}

function drawGraph() {
  const canvas = document.getElementById("graph");
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(TRACK_HEIGHT * ratio);
  if (!width) return;
  page.shares = sharesOf(document.getElementById("over").value);
  Object.assign(canvas, { width, height: height * page.tracks.length });
  const pen = canvas.getContext("2d");
  page.tracks.forEach((track, n) => {
    const { low, high } = extremes(track.values, page.shares, width);
    const size = track.high - track.low || 1;
    const y = (value) => n * height + (0.08 + 0.84 * (track.high - value) / size) * height;
    pen.fillStyle = n % 2 ? "#ffffff" : "#f3f5f8";
    pen.fillRect(0, n * height, width, height);
    pen.strokeStyle = TRACK_COLOURS[n % TRACK_COLOURS.length];
    pen.lineWidth = ratio;
    pen.beginPath();
    for (let x = 0, begun = false; x < width; x++) {
      if (low[x] > high[x]) continue;
      if (begun) pen.lineTo(x + 0.5, y(low[x])); else pen.moveTo(x + 0.5, y(low[x]) + 0.5);
      pen.lineTo(x + 0.5, y(high[x]));
      begun = true;
    }
    pen.stroke();
  });
  showCursor(page.state.step);
}

function showCursor(step) {
  if (!page.shares) return;
  document.getElementById("cursor").style.left = `${100 * page.shares[step]}%`;
  page.tracks.forEach(({ name, unit, digits, values, low, high }, n) => {
    const label = document.getElementById("tracks").children[n];
    label.replaceChildren(`${name} `, make("b", Number.isNaN(values[step]) ? "rapid" : number(values[step], digits)), make("i", ` (${number(low, digits)} to ${number(high, digits)}${unit})`));
  });
}

// The first of ascending `values` that is not below `value`, the last where all are.
function firstFrom(values, value) {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

// The line, from 1, of the next match at or behind line `from`, going round at the end; 0 for none. A number is that of a
// block (a number or an N word at its beginning) or, where no block has it, of a line of the file.
function findLine(sought, from) {
  const starts = lineStarts(), text = programText();
  const digits = /^[n:]?\s*0*(\d+)$/.exec(sought);
  const start = starts[Math.min(from, starts.length) - 1];
  let at;
  if (digits) {
    const block = new RegExp(`^[ \\t]*[n:]?0*${digits[1]}(?![\\d.])`, "gm");
    block.lastIndex = start;
    const match = block.exec(text) || block.exec(text); // a search that fails begins the next at the top
    if (!match) return Number(digits[1]) < starts.length ? Number(digits[1]) : 0;
    at = match.index;
  } else {
    at = text.indexOf(sought, start);
    if (at < 0) at = text.indexOf(sought);
    if (at < 0) return 0;
  }
  const line = firstFrom(starts, at + 1);
  return starts[line] > at ? line : line + 1;
}

// Goes to the move of the next match, or the first one behind it where the line moves nothing.
function find() {
  const sought = document.getElementById("find").value.trim().toLowerCase();
  const told = document.getElementById("found");
  const lines = page.arrays.move_line, last = page.found;
  told.textContent = "";
  if (!sought) return;
  const again = last && last.sought === sought && last.step === page.state.step;
  const line = findLine(sought, again ? last.line + 1 : lines[page.state.step]);
  if (!line) { told.textContent = `nothing found: ${sought}`; return; }
  goTo(firstFrom(lines, line));
  page.found = { sought, line, step: page.state.step };
  told.textContent = `line ${line}: ${lineText(line)}`;
}

function makeTimeline() {
  page.tracks = tracksOf();
  const canvas = document.getElementById("graph");
  canvas.style.height = `${TRACK_HEIGHT * page.tracks.length}px`;
  document.getElementById("tracks").append(...page.tracks.map((_, n) => { const label = make("span"); label.style.color = TRACK_COLOURS[n % TRACK_COLOURS.length]; return label; }));
  const jump = (event) => goTo(firstFrom(page.shares, (event.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth));
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); jump(event); });
  canvas.addEventListener("pointermove", (event) => { if (event.buttons & 1) jump(event); });
  document.getElementById("over").addEventListener("change", drawGraph);
  document.getElementById("find").addEventListener("keydown", (event) => { if (event.key === "Enter") find(); });
  new ResizeObserver(drawGraph).observe(canvas);
}
