// The page: state, views, keys. `page.state` is all that a reader can change.
const page = {
  state: { mode: "levels", level: 0, open: false, colouring: "kind", links: true, rapids: false, axes: false, cones: false, uncut: false, machine: false,
    outer: false, step: 0, chosen: -1, bodies: { stock: false, solid: true, post: true, chuck: true, tailstock: true, table: true, zero: true, holder: true } },
  labels: [],
  ready: false,
};
const MODES = { fit: fitMode, levels: levelsMode, path: pathMode, program: programMode, left: leftMode };
const BODY_NAMES = { stock: "stock", solid: "kept clear of", post: "post", chuck: "chuck", tailstock: "tailstock", table: "table", zero: "zero", holder: "holder, spindle" };
const VIEWS = { Front: [-Math.PI / 2, 0], Back: [Math.PI / 2, 0], Left: [Math.PI, 0], Right: [0, 0], Top: [-Math.PI / 2, 1.55] };
const KEYS = "1–5  fit, levels, paths, program, left\n← →  level or block (shift: 100 blocks)\nspace  play or stop      /  find a block\nc  cut open\nv  front, back, left, right, top\nr  first view      a  all of the machine\n+ −  zoom      arrows with ctrl  turn";

function change(values) {
  Object.assign(page.state, values);
  rebuild();
}

function rebuild() {
  const mode = MODES[page.state.mode];
  for (const child of [...page.content.children]) { page.content.remove(child); dispose(child); }
  page.labels = [];
  if (page.state.mode !== "program") play(false);
  mode.build(page.state);
  const focused = document.activeElement && document.activeElement.id;
  const controls = document.getElementById("controls");
  controls.replaceChildren(...mode.controls(page.state));
  if (focused && controls.querySelector(`#${CSS.escape(focused)}`)) document.getElementById(focused).focus();
  for (const button of document.querySelectorAll("#modes button")) button.setAttribute("aria-selected", String(button.dataset.mode === page.state.mode));
  document.getElementById("player").hidden = page.state.mode !== "program";
  const chosen = page.state.mode === "path" && page.state.chosen >= 0;
  document.getElementById("picked").hidden = !chosen;
  if (chosen) document.getElementById("picked").textContent = pickedWords(page.state.chosen);
  showBodies();
  moveWorld();
  page.redraw();
}

function showBodies() {
  for (const [name, body] of Object.entries(page.bodies)) body.visible = page.state.bodies[name];
  if (page.state.mode === "fit") for (const name of ["post", "stock", "chuck", "tailstock", "table", "zero"]) if (page.bodies[name]) page.bodies[name].visible = false;
  page.content.traverse((item) => { if (item.name === "holder" || item.name === "spindle") item.visible = page.state.bodies.holder; });
}

function setMode(mode) {
  if (MODES[mode].available && !MODES[mode].available()) return;
  const before = page.state.mode;
  change({ mode });
  if ((before === "program") !== (mode === "program") || (before === "fit") !== (mode === "fit")) firstView();
}

function firstView() {
  const { low, high } = page.part;
  if (page.state.mode === "program") {
    page.orbit.fit(low.clone().setZ(low.z - 12), high.clone().setZ(high.z + 20), 0.32); // above the player
  } else if (page.state.mode === "fit") {
    page.orbit.fit(low.clone().setZ(low.z - 1), high.clone().setZ(high.z + 3));
  } else {
    page.orbit.fit(low.clone().setZ(low.z - 4), high.clone().setZ(high.z + 2));
  }
}

function wholeMachine() {
  const radius = Math.min(page.facts.table.radius || 120, 120);
  const low = page.state.machine ? -2 * radius : 0; // a table that turns sinks, and the player covers what is below
  page.orbit.fit(new THREE.Vector3(-radius, -radius, low), new THREE.Vector3(radius, radius, page.part.high.z + 60));
}

function draw() {
  page.waiting = false;
  const { clientWidth: width, clientHeight: height } = page.canvas;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  if (page.canvas.width !== Math.floor(width * ratio) || page.canvas.height !== Math.floor(height * ratio)) {
    page.renderer.setPixelRatio(ratio);
    page.renderer.setSize(width, height, false);
    page.orbit.camera.aspect = width / height;
  }
  page.orbit.update();
  page.light.position.copy(page.orbit.camera.position);
  const view = page.orbit;
  CLIP.normal.set(-Math.cos(view.azimuth), -Math.sin(view.azimuth), 0);
  page.renderer.render(page.scene, page.orbit.camera);
  placeLabels(width, height);
  page.drawn = (page.drawn || 0) + 1;
}

function placeLabels(width, height) {
  const box = document.getElementById("labels");
  box.replaceChildren();
  for (const [text, object, z] of page.labels) {
    const point = new THREE.Vector3(object.position.x, object.position.y, z + 1.5).project(page.orbit.camera);
    const label = make("span", text);
    label.style.left = `${((point.x + 1) * width) / 2}px`;
    label.style.top = `${((1 - point.y) * height) / 2 - 22}px`;
    box.append(label);
  }
}

function onKey(event) {
  if (event.target.matches("select, input[type=search]")) return;
  const key = event.key;
  const inRange = event.target.type === "range";
  const modes = Object.keys(MODES);
  if (key >= "1" && key <= "5") setMode(modes[Number(key) - 1]);
  else if (key === " " && page.state.mode === "program") { if (event.target.tagName !== "BUTTON") { play(!page.playing); event.preventDefault(); } }
  else if (event.ctrlKey && key.startsWith("Arrow")) {
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key];
    page.orbit.turn(0.1 * x, 0.1 * y);
    event.preventDefault();
  } else if ((key === "ArrowLeft" || key === "ArrowRight") && !inRange) {
    const by = (key === "ArrowRight" ? 1 : -1) * (event.shiftKey ? 100 : 1);
    if (page.state.mode === "program") goTo(page.state.step + by);
    else if (page.state.mode === "path") stepLayer(Math.sign(by));
    else change({ level: Math.max(0, Math.min(page.facts.levels.length - 1, page.state.level + Math.sign(by))) });
  } else if (key === "/" && page.state.mode === "program") { document.getElementById("find").focus(); event.preventDefault(); }
  else if (key === "c" && levelsMode.available()) change({ mode: "levels", open: !page.state.open });
  else if (key === "v") nextView();
  else if (key === "r") { page.orbit.look(...FIRST_VIEW); firstView(); }
  else if (key === "a") wholeMachine();
  else if (key === "+" || key === "=") page.orbit.zoom(0.85);
  else if (key === "-") page.orbit.zoom(1.18);
  else if (key === "?") document.getElementById("help").toggleAttribute("hidden");
}

function stepLayer(by) {
  const layers = page.facts.program.layers;
  const at = layers.indexOf(shownLayer(page.state)) + by;
  change({ level: layers[Math.max(0, Math.min(layers.length - 1, at))].level });
}

function nextView() {
  const names = Object.keys(VIEWS);
  page.viewed = ((page.viewed === undefined ? -1 : page.viewed) + 1) % names.length;
  page.orbit.look(...VIEWS[names[page.viewed]]);
  if (page.state.mode === "fit") rebuild();
}

function makeBodies() {
  const { post, riser, chuck, stub, tailstock, table, stock_bounds: bounds } = page.facts;
  const upright = (column) => (column ? [[column.bottom || 0, column.top, column.radius, column.radius, column.x, column.y]] : []);
  const last = page.facts.levels[page.facts.levels.length - 1];
  const clear = (vertices, faces) => surface(vertices, faces, null, { colour: "#9fb4c7", opacity: 0.25 });
  page.bodies = {
    ...(post ? { post: revolved([...upright(stub), ...postPieces(post, Math.min(post.top, bounds[0][2] + post.radius))], METAL) } : {}),
    table: tableBody(table),
    zero: zeroMark(25),
  };
  if (page.arrays.solid) page.bodies.solid = clear(page.arrays.solid, page.arrays.solid_faces);
  else page.bodies.stock = clear(page.arrays[`level_${last.index}`], page.arrays[last.faces]);
  if (chuck || riser) page.bodies.chuck = revolved([...upright(riser), ...upright(chuck)], "#98a4b0");
  if (tailstock) page.bodies.tailstock = revolved(tailstock.flatMap(upright), "#98a4b0");
  for (const body of Object.values(page.bodies)) page.world.add(body);
}

function makePanel() {
  const facts = page.facts;
  document.title = `${facts.name} · bonecam`;
  document.getElementById("name").textContent = facts.name;
  const program = facts.program;
  const about = [facts.stock.text, program ? `${program.machine} / ${program.controller}, ${timeWords(program)}` : `${facts.levels.length - 1} cuts`, `bonecam ${facts.version}`];
  document.getElementById("about").textContent = about.join(" · ");
  document.getElementById("summary").textContent = facts.summary;
  document.getElementById("report").textContent = JSON.stringify(facts.report, null, 1);
  const warnings = document.getElementById("warnings");
  const told = [...facts.report.warnings, ...(facts.report.second ? facts.report.second.warnings : [])];
  warnings.hidden = !told.length;
  warnings.append(...told.map((each) => make("li", `${each.text}: ${each.remedy}`)));
  for (const [key, mode] of Object.entries(MODES)) {
    if (mode.available && !mode.available()) continue;
    const button = make("button", mode.name);
    button.dataset.mode = key;
    button.setAttribute("role", "tab");
    button.addEventListener("click", () => setMode(key));
    document.getElementById("modes").append(button);
  }
  const list = document.getElementById("body-list");
  for (const [name, text] of Object.entries(BODY_NAMES)) {
    if (!page.bodies[name] && !(name === "holder" && facts.tools)) continue;
    list.append(check(`body-${name}`, (name === "solid" && facts.solid) || text, page.state.bodies[name], (value) => { page.state.bodies[name] = value; showBodies(); page.redraw(); }));
  }
  for (const [name, angles] of Object.entries(VIEWS)) {
    const button = make("button", name);
    button.addEventListener("click", () => { page.orbit.look(...angles); if (page.state.mode === "fit") rebuild(); });
    document.getElementById("views").append(button);
  }
  const all = make("button", "All");
  all.title = "all of the machine (a)";
  all.addEventListener("click", wholeMachine);
  document.getElementById("views").append(all);
  document.getElementById("help").textContent = KEYS;
}

function makePlayer() {
  if (!page.arrays.move_kind) return;
  const step = document.getElementById("step");
  step.max = page.arrays.move_kind.length - 1;
  step.addEventListener("input", () => goTo(Number(step.value)));
  document.getElementById("play").addEventListener("click", () => play(!page.playing));
  makeTimeline();
}

function listen() {
  let down = null;
  page.canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
  page.canvas.addEventListener("click", (event) => {
    if (page.state.mode !== "path" || !down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4) return;
    const box = page.canvas.getBoundingClientRect();
    change({ chosen: pick(event.clientX - box.left, event.clientY - box.top) });
  });
  document.addEventListener("keydown", onKey);
  new ResizeObserver(() => page.redraw()).observe(page.canvas);
}

async function start() {
  THREE.ColorManagement.enabled = false; // colours are those of the screen, as given
  const { facts, arrays } = await unpack(document.getElementById("payload").textContent);
  Object.assign(page, { facts, arrays, canvas: document.getElementById("canvas") });
  page.renderer = new THREE.WebGLRenderer({ canvas: page.canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  page.renderer.localClippingEnabled = true;
  page.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  page.redraw = () => { if (!page.waiting) { page.waiting = true; requestAnimationFrame(draw); } };
  page.orbit = new Orbit(page.canvas, () => page.redraw());
  page.scene = new THREE.Scene();
  page.light = new THREE.DirectionalLight(0xffffff, 0.5 * Math.PI);
  page.scene.add(new THREE.HemisphereLight(0xffffff, 0xc9c5bf, 0.6 * Math.PI), page.light);
  page.content = new THREE.Group();
  page.world = new THREE.Group(); // what the machine moves
  page.world.matrixAutoUpdate = false;
  page.scene.add(page.world);
  page.world.add(page.content);
  const [low, high] = facts.stock_bounds.map((corner) => new THREE.Vector3(...corner));
  page.part = { low, high };
  makeBodies();
  makePanel();
  makePlayer();
  listen();
  if (!levelsMode.available()) page.state.mode = "path";
  rebuild();
  page.orbit.camera.aspect = page.canvas.clientWidth / Math.max(page.canvas.clientHeight, 1);
  firstView();
  document.getElementById("wait").remove();
  draw();
  page.ready = true;
}

start().catch((error) => {
  const wait = document.getElementById("wait") || document.getElementById("stage").appendChild(make("p", "", ""));
  wait.textContent = `This page cannot be drawn here: ${error.message}. It needs WebGL and a browser of 2023 or later.`;
  console.error(error);
});
