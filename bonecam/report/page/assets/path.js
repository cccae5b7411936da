// The view of the path of one level.
const KINDS = ["cut", "link", "rapid"];
const MOST_AXES = 400, AXIS_DRAWN = 4;

// The level or layer of the program that is shown: the chosen one, or the next one inside it.
function shownLayer(state) {
  const layers = page.facts.program.layers;
  return layers.filter((layer) => layer.level <= state.level).pop() || layers[0];
}

function layerTitle(layer) {
  return layer.surface === layer.level ? levelTitle(layer.level) : `Layer ${layer.level}, on the part`;
}

function pathColouring(state) {
  const a = page.arrays;
  const tilt = (i) => (Math.acos(Math.max(-1, Math.min(1, a.move_axis[3 * i + 2]))) * 180) / Math.PI;
  const all = {
    kind: { title: "Kind of move", items: KINDS.map((kind, k) => [KIND_COLOURS[k], kind]) },
    feed: { title: "Feed", unit: "mm/min", value: (i) => a.move_feed[i], digits: 0 },
    tilt: { title: "Tilt of the tool from the post's axis", unit: "degrees", value: tilt, digits: 0 },
    depth: { title: "Depth of cut, simulated", unit: "mm", value: (i) => a.move_depth[i] },
    force: { title: "Mean force over a turn of the spindle", unit: "N", value: (i) => a.move_force[i], digits: 1 },
    section: { title: "Engagement: section of the chip", unit: "mm²", value: (i) => a.move_section[i], digits: 3 },
  };
  return all[state.colouring];
}

function pathChoices() {
  const simulated = page.arrays.move_depth ? [["depth", "depth of cut"], ["section", "engagement"]] : [];
  const force = page.arrays.move_force ? [["force", "force"]] : [];
  return [["kind", "kind of move"], ["feed", "feed"], ["tilt", "tilt"], ...simulated, ...force];
}

const pathMode = {
  name: "Paths",
  available: () => Boolean(page.arrays.move_tip),
  build(state) {
    const a = page.arrays;
    const layer = shownLayer(state);
    const k = layer.level;
    const moves = movesOf(k, state);
    const colouring = pathColouring(state);
    let low = Infinity, high = -Infinity;
    if (colouring.value) {
      for (const i of moves) if (a.move_kind[i] === 0) { low = Math.min(low, colouring.value(i)); high = Math.max(high, colouring.value(i)); }
      if (!(low < high)) { low = Math.min(low, 0); high = low + 1; }
    }
    const positions = new Float32Array(6 * moves.length), colours = new Float32Array(6 * moves.length);
    moves.forEach((i, n) => {
      const from = Math.max(i - 1, 0);
      const colour = colouring.value ? colourAt("viridis", (colouring.value(i) - low) / (high - low)) : rgb(KIND_COLOURS[a.move_kind[i]]);
      positions.set(a.move_contact.subarray(3 * from, 3 * from + 3), 6 * n);
      positions.set(a.move_contact.subarray(3 * i, 3 * i + 3), 6 * n + 3);
      colours.set(colour, 6 * n);
      colours.set(colour, 6 * n + 3);
    });
    page.content.add(levelMesh(layer.surface, null, { colour: "#eef0f2" }), lines(positions, colours));
    if (state.axes) page.content.add(axesOf(moves));
    if (state.cones) page.content.add(conesOf(state.chosen >= 0 && a.move_level[state.chosen] === k ? [state.chosen] : someCones(moves), coneLength()));
    if (state.chosen >= 0 && a.move_level[state.chosen] === k) page.content.add(placeTool(state.chosen, true));
    showLegend(colouring.value ? { ...colouring, scale: "viridis", low, high } : colouring);
  },
  controls: (state) => {
    const layers = page.facts.program.layers;
    const layer = shownLayer(state);
    const shown = page.facts.program;
    const thinned = shown.chord ? [make("p", `${page.arrays.move_kind.length} of ${shown.blocks} moves: the others lie within ${shown.chord} mm of the lines shown`)] : [];
    return [
      make("p", layerTitle(layer), "big"),
      ...(layers.length > 1 ? [slider("level", "from the part to the stock", 0, layers.length - 1, layers.indexOf(layer), (value) => change({ level: layers[value].level }))] : []),
      choice("colouring", "colours tell the", pathChoices(), state.colouring, (value) => change({ colouring: value })),
      row(
        check("links", "links", state.links, (value) => change({ links: value })),
        check("rapids", "rapids", state.rapids, (value) => change({ rapids: value })),
        check("axes", "tool axes", state.axes, (value) => change({ axes: value })),
        ...(page.arrays.move_cone ? [check("cones", "cones", state.cones, (value) => change({ cones: value }))] : []),
      ),
      ...(state.cones ? [make("p", "cones of free tool axes, apex at the ball's centre, each with the axis chosen in it: some of the level, or the one that is clicked")] : []),
      make("p", "click on the path: block, feed and tool there"),
      ...thinned,
    ];
  },
};

function movesOf(k, state) {
  const a = page.arrays;
  const found = [];
  for (let i = 1; i < a.move_level.length; i++) {
    if (a.move_level[i] !== k) continue;
    const kind = a.move_kind[i];
    if ((kind === 1 && !state.links) || (kind === 2 && !state.rapids)) continue;
    found.push(i);
  }
  return found;
}

function axesOf(moves) {
  const a = page.arrays;
  const cuts = moves.filter((i) => a.move_kind[i] === 0);
  const every = Math.max(1, Math.floor(cuts.length / MOST_AXES));
  const chosen = cuts.filter((_, n) => n % every === 0);
  const positions = new Float32Array(6 * chosen.length), colours = new Float32Array(6 * chosen.length);
  chosen.forEach((i, n) => {
    for (let c = 0; c < 3; c++) {
      const start = a.move_contact[3 * i + c];
      positions[6 * n + c] = start;
      positions[6 * n + 3 + c] = start + AXIS_DRAWN * a.move_axis[3 * i + c];
    }
    colours.set([...rgb("#d55e00"), ...rgb("#d55e00")], 6 * n);
  });
  return lines(positions, colours, 0.6);
}

// The move whose contact is seen nearest to a place of the canvas, -1 for none within 12 pixels.
function pick(x, y) {
  const a = page.arrays;
  const k = shownLayer(page.state).level;
  const matrix = new THREE.Matrix4().multiplyMatrices(page.orbit.camera.projectionMatrix, page.orbit.camera.matrixWorldInverse);
  const width = page.canvas.clientWidth, height = page.canvas.clientHeight;
  const point = new THREE.Vector3();
  let best = -1, bestScore = Infinity;
  for (const i of movesOf(k, page.state)) {
    if (a.move_kind[i] !== 0) continue;
    point.set(a.move_contact[3 * i], a.move_contact[3 * i + 1], a.move_contact[3 * i + 2]).applyMatrix4(matrix);
    const away = Math.hypot(((point.x + 1) * width) / 2 - x, ((1 - point.y) * height) / 2 - y);
    const score = away + 4000 * point.z; // of places behind one another the front one
    if (away < 12 && score < bestScore) { best = i; bestScore = score; }
  }
  return best;
}

function pickedWords(i) {
  const a = page.arrays;
  const values = [
    `block: ${lineText(a.move_line[i])}`,
    `${KINDS[a.move_kind[i]]}, feed ${number(a.move_feed[i], 0)} mm/min, tilt ${number((Math.acos(a.move_axis[3 * i + 2]) * 180) / Math.PI, 1)} degrees`,
  ];
  if (a.move_cone && a.move_kind[i] === 0) values.push(coneWords(i));
  if (a.move_depth) values.push(`depth of cut ${number(a.move_depth[i])} mm, section of the chip ${number(a.move_section[i], 3)} mm²`);
  if (a.move_force) values.push(`mean force ${number(a.move_force[i], 1)} N`);
  return values.join("\n");
}
