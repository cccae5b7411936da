// The view that plays the program: tool, standing stock, blocks.
const REWOUND = "#d55e00", TRAIL = 400, BLOCKS_ABOVE = 2, BLOCKS_BELOW = 3;

// Where the lines of the text begin.
function lineStarts() {
  if (!page.lineStarts) {
    const text = page.arrays.text;
    page.lineStarts = [0];
    for (let i = 0; i < text.length; i++) if (text[i] === 10) page.lineStarts.push(i + 1);
  }
  return page.lineStarts;
}

function lineText(line) {
  const starts = lineStarts();
  if (line < 1 || line >= starts.length) return "";
  const bytes = page.arrays.text.subarray(starts[line - 1], starts[line] - 1);
  return String.fromCharCode(...Array.from(bytes));
}

// The text in small letters, one for each byte.
function programText() {
  if (!page.programText) page.programText = new TextDecoder("latin1").decode(page.arrays.text).toLowerCase();
  return page.programText;
}

function rewindPoints(places) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
  return new THREE.Points(geometry, new THREE.PointsMaterial({ size: 7, sizeAttenuation: false, color: new THREE.Color(REWOUND) }));
}

function placeTool(i, ghost) {
  const a = page.arrays;
  const tool = page.facts.tools.find((one) => one.number === a.move_tool[i]);
  const body = toolBody(tool);
  if (ghost) body.traverse((item) => { if (item.material) { item.material.transparent = true; item.material.opacity = Math.min(item.material.opacity, 0.45); } });
  setTool(body, i);
  return body;
}

function setTool(body, i) {
  const a = page.arrays;
  body.position.set(a.move_tip[3 * i], a.move_tip[3 * i + 1], a.move_tip[3 * i + 2]);
  const axis = new THREE.Vector3(a.move_axis[3 * i], a.move_axis[3 * i + 1], a.move_axis[3 * i + 2]).normalize();
  body.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis);
}

// The stock that stands while a level is cut: each vertex moves from where it stood before to where it stands after
// when the move that cuts it has come.
class StandingStock {
  constructor({ level: k, surface: followed }) {
    const a = page.arrays;
    this.level = k;
    this.base = a[`level_${followed}`];
    this.mesh = surface(new Float32Array(this.base), a[page.facts.levels[followed].faces], new Float32Array(this.base.length));
    const normals = this.mesh.geometry.attributes.normal.array;
    this.normals = new Float32Array(normals);
    this.before = a[`before_${k}`];
    this.after = a[`after_${k}`];
    const cutAt = a[`cut_at_${k}`];
    this.order = cutAt ? Uint32Array.from(cutAt.keys()).sort((p, q) => cutAt[p] - cutAt[q]) : new Uint32Array(0);
    this.cutAt = cutAt;
    this.done = 0;
    for (let v = 0; v < this.base.length / 3; v++) this.put(v, false);
    this.refresh();
  }

  put(v, cut) {
    const position = this.mesh.geometry.attributes.position.array;
    const height = this.before ? (cut ? this.after[v] : this.before[v]) : 0;
    for (let c = 0; c < 3; c++) position[3 * v + c] = this.base[3 * v + c] + height * this.normals[3 * v + c];
    this.mesh.geometry.attributes.color.array.set(cut ? rgb(CUT) : rgb(BONE), 3 * v);
  }

  to(step) {
    const start = this.done;
    while (this.done < this.order.length && this.cutAt[this.order[this.done]] <= step) this.put(this.order[this.done++], true);
    while (this.done > 0 && this.cutAt[this.order[this.done - 1]] > step) this.put(this.order[--this.done], false);
    if (this.done !== start) this.refresh();
  }

  refresh() {
    const geometry = this.mesh.geometry;
    geometry.attributes.position.needsUpdate = geometry.attributes.color.needsUpdate = true;
    geometry.computeVertexNormals();
  }
}

const programMode = {
  name: "Program",
  available: () => Boolean(page.arrays.move_tip),
  build(state) {
    const a = page.arrays;
    page.standing = null;
    page.tool = null;
    page.cone = null;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(a.move_tip, 3));
    page.trail = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: new THREE.Color("#0072b2") }));
    page.trail.frustumCulled = false;
    page.content.add(page.trail);
    const rewinds = a.rewinds ? [[REWOUND, "left to rewind rotary axes"]] : [];
    if (a.rewinds) page.content.add(rewindPoints(a.rewinds));
    showLegend({ title: "Standing stock", items: [[BONE, "as it stood when the level began"], [CUT, "cut on this level so far"], ["#0072b2", `path of the tip, the last ${TRAIL} moves`], ["#e69f00", "cutter"], ...rewinds] });
    showStep(state.step);
  },
  controls: (state) => [
    make("p", "The posted program, read back", "big"),
    make("p", `${page.facts.program.blocks} moving blocks, ${timeWords(page.facts.program)}. ` +
      (page.facts.program.layers.some((layer) => a0(`before_${layer.level}`)) ? "The stock is as simulated from the text, at the vertices of each level." : "Without a simulation the level that is cut is shown in place of the stock.")),
    ...(page.facts.program.kinematics ? [check("machine", `the machine moves: table X, Y${lettersOf("table")}, head Z${lettersOf("head")}`, state.machine, (value) => { change({ machine: value }); wholeMachine(); })] : []),
    ...(page.arrays.move_cone ? [check("cones", "cone of free axes where the tool cuts", state.cones, (value) => change({ cones: value }))] : []),
    ...(cutLayers().length < 2 ? [] : [choice("jump", "go to level", cutLayers().map((layer) => [String(layer.level), layerTitle(layer)]), String(page.arrays.move_level[state.step]), (value) => goTo(firstMoveOf(Number(value))))]),
  ],
};

const lettersOf = (side) => page.facts.program.kinematics[side].map(([letter]) => `, ${letter}`).join("");

// The turn about a rotary axis [letter, direction, pivot] at a move.
function turnAt([letter, direction, pivot], step) {
  const angle = (page.arrays[`move_angle_${letter}`][step] * Math.PI) / 180;
  const turn = new THREE.Matrix4().makeRotationAxis(new THREE.Vector3(...direction), angle);
  const place = new THREE.Vector3(...pivot);
  return turn.setPosition(place.clone().sub(place.clone().applyMatrix4(turn)));
}

// Moves part, table and tool as the machine stands at a move, in its own frame, Z up: the table in X, Y and its rotary axes,
// the head in Z and its own. The place that X and Y bring under the head is the middle, the program's zero at rest the
// height 0. Nothing moves in other views.
function moveWorld() {
  const matrix = page.world.matrix.identity();
  const { step } = page.state;
  if (page.state.mode === "program" && page.state.machine) {
    const { table, head, zero, frame } = page.facts.program.kinematics;
    matrix.makeBasis(...frame.map((row) => new THREE.Vector3(...row))).setPosition(...zero);
    for (const axis of table) matrix.premultiply(turnAt(axis, step));
    const tip = new THREE.Vector3().fromArray(page.arrays.move_tip, 3 * step).applyMatrix4(matrix);
    // from where the tip stands under the head, its axes at zero
    const { length } = page.facts.tools.find((one) => one.number === page.arrays.move_tool[step]);
    const swung = new THREE.Vector3(0, 0, -length);
    for (const axis of [...head].reverse()) swung.applyMatrix4(turnAt(axis, step));
    matrix.premultiply(new THREE.Matrix4().makeTranslation(swung.x - tip.x, swung.y - tip.y, -zero[2]));
  }
  page.world.matrixWorldNeedsUpdate = true;
}

const PARTED = 65537; // the level of moves that part the part from its post
const timeWords = (program) => program.time || `about ${number(program.minutes, 1)} min`; // folders kept by earlier versions have minutes
const a0 = (name) => page.arrays[name];
const cutLayers = () => [...page.facts.program.layers].reverse();
const firstMoveOf = (k) => page.arrays.move_level.indexOf(k);

function goTo(step) {
  const last = page.arrays.move_kind.length - 1;
  page.state.step = Math.max(0, Math.min(last, step));
  document.getElementById("step").value = page.state.step;
  if (page.state.mode === "program") showStep(page.state.step);
}

function showStep(i) {
  const a = page.arrays;
  const k = a.move_level[i];
  if (!page.standing || page.standing.level !== k) {
    if (page.standing) { page.content.remove(page.standing.mesh); dispose(page.standing.mesh); }
    const layer = page.facts.program.layers.find((one) => one.level === (k === PARTED ? 0 : k));
    page.standing = layer ? new StandingStock(layer) : null;
    if (page.standing) page.content.add(page.standing.mesh);
    const jump = document.getElementById("jump");
    if (jump) jump.value = String(k);
  }
  if (page.standing) page.standing.to(i);
  if (!page.tool || page.tool.number !== a.move_tool[i]) {
    if (page.tool) page.content.remove(page.tool.body);
    page.tool = { number: a.move_tool[i], body: placeTool(i, false) };
    page.content.add(page.tool.body);
  }
  setTool(page.tool.body, i);
  if (page.cone) { page.content.remove(page.cone); dispose(page.cone); page.cone = null; }
  if (page.state.cones && a.move_kind[i] === 0 && coneOf(i) >= 0) page.content.add((page.cone = conesOf([i], CONE_PLAYED)));
  const start = Math.max(0, i - TRAIL);
  page.trail.geometry.setDrawRange(start, i - start + 1);
  showReadout(i);
  showCursor(i);
  moveWorld();
  page.redraw();
}

function showReadout(i) {
  const a = page.arrays;
  const k = a.move_level[i];
  const tip = [0, 1, 2].map((c) => number(a.move_tip[3 * i + c], 3));
  const tilt = (Math.acos(Math.max(-1, Math.min(1, a.move_axis[3 * i + 2]))) * 180) / Math.PI;
  const tool = page.facts.tools.find((one) => one.number === a.move_tool[i]);
  const move = a.move_feed[i] > 0 ? [KINDS[a.move_kind[i]], `${number(a.move_feed[i], 0)} mm/min`] : ["move", "rapid"];
  const told = [
    k === PARTED ? ["parting", "from the post"] : ["level", k], ["tool", `${tool.number}, ${tool.end} R ${tool.radius}`], ["tip", `X ${tip[0]}  Y ${tip[1]}  Z ${tip[2]}`],
    ["tilt", `${number(tilt, 1)}°`], ...(page.state.cones && a.move_cone && a.move_kind[i] === 0 ? [["cone", coneOf(i) < 0 ? "none" : `±${coneAngles(coneOf(i))}°`]] : []), move, ["time in feed", `${number(a.move_minute[i], 1)} min`],
  ];
  const box = document.getElementById("readout");
  box.replaceChildren(...told.map(([name, value]) => { const item = make("span", `${name} `); item.append(make("b", String(value))); return item; }));
  const line = a.move_line[i];
  const blocks = document.getElementById("blocks");
  blocks.replaceChildren();
  for (let n = line - BLOCKS_ABOVE; n <= line + BLOCKS_BELOW; n++) {
    const text = lineText(n) + "\n";
    blocks.append(n === line ? make("b", text) : text);
  }
}

function play(on) {
  page.playing = on;
  page.played = 0;
  page.before = performance.now();
  document.getElementById("play").innerHTML = on ? "&#10074;&#10074;" : "&#9654;";
  if (on) requestAnimationFrame(playFrame);
}

function playFrame(now) {
  if (!page.playing) return;
  page.played += ((now - page.before) / 1000) * Number(document.getElementById("speed").value);
  page.before = now;
  const steps = Math.floor(page.played);
  page.played -= steps;
  if (steps) goTo(page.state.step + steps);
  if (page.state.step >= page.arrays.move_kind.length - 1) play(false);
  requestAnimationFrame(playFrame);
}
